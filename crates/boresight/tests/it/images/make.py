"""Writes the tiny test images with encoders that are not ours (Pillow, tifffile, OpenCV, ffmpeg). Run in this folder.

All show the same formulas, 19 x 11 pixels, page p: g8 = (7x + 13y + 31p) % 256; g16 = (1031x + 557y + 7001p) % 65536;
f32 = x/2 - y + p/4; rgb = (g8, (g8 + 85) % 256, 255 - g8). tests/it/images.rs computes them anew.
"""
import subprocess

import cv2
import numpy as np
import tifffile
from PIL import Image

W, H, P = 19, 11, 3
p, y, x = np.mgrid[0:P, 0:H, 0:W]
g8 = ((7 * x + 13 * y + 31 * p) % 256).astype(np.uint8)
g16 = ((1031 * x + 557 * y + 7001 * p) % 65536).astype(np.uint16)
f32 = (x / 2 - y + p / 4).astype(np.float32)
rgb = np.stack([g8, (g8.astype(int) + 85) % 256, 255 - g8.astype(int)], -1).astype(np.uint8)
bit = Image.fromarray(g8[0]).point(lambda v: 255 if v > 127 else 0).convert("1", dither=0)

Image.fromarray(g8[0]).save("g8.png")
Image.fromarray(g16[0]).save("g16.png")
Image.fromarray(rgb[0]).save("rgb.png")
Image.fromarray(np.dstack([rgb[0], g8[1]])).save("rgb_alpha.png")
Image.fromarray(rgb[0]).quantize(256, dither=0).save("rgb_palette.png")
bit.save("bit.png")
bit.save("bit.bmp")
Image.fromarray(g8[0]).save("g8.bmp")
Image.fromarray(rgb[0]).save("rgb.bmp")
cv2.imwrite("g16.pgm", g16[0])
cv2.imwrite("rgb.ppm", rgb[0][..., ::-1])
cv2.imwrite("f32.pfm", f32[0])
smooth = cv2.GaussianBlur(g8[0], (0, 0), 2)
Image.fromarray(smooth).save("smooth.jpg", quality=95)
Image.fromarray(smooth).save("smooth_progressive.jpg", quality=95, progressive=True)
Image.fromarray(smooth).convert("RGB").save("smooth_rgb.jpg", quality=95, subsampling=2)
gray = dict(photometric="minisblack", metadata=None)
tifffile.imwrite("g8.tif", g8, **gray)
tifffile.imwrite("g16_lzw.tif", g16, compression="lzw", predictor=True, **gray)
tifffile.imwrite("g16_tiled.tif", g16, compression="deflate", tile=(16, 16), **gray)
tifffile.imwrite("g16_big.tif", g16, bigtiff=True, byteorder=">", rowsperstrip=4, **gray)
tifffile.imwrite("g16_imagej.tif", g16, imagej=True)
tifffile.imwrite("f32_deflate.tif", f32, compression="deflate", predictor=True, **gray)
tifffile.imwrite("rgb_planes.tif", rgb.transpose(0, 3, 1, 2).copy(), photometric="rgb", planarconfig="separate", metadata=None)
g12 = g16 >> 4
tifffile.imwrite("g12_packed.tif", g12, bitspersample=12, **gray)
ramp = np.arange(256, dtype=np.uint16)
table = np.stack([ramp * 257, (ramp + 85) % 256 * 257, (255 - ramp) * 257]).astype(np.uint16)
tifffile.imwrite("rgb_palette.tif", g8, photometric="palette", colormap=table, metadata=None)
frames = [Image.fromarray(g8[k]) for k in range(P)]
frames[0].save("g8.gif", save_all=True, append_images=frames[1:], duration=[40, 70, 100])
for name, pix, data in [("g8.y4m", "gray", g8), ("g16.y4m", "gray16le", g16)]:
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", pix, "-s", f"{W}x{H}", "-r", "30000/1001",
                    "-i", "-", "-pix_fmt", pix, "-strict", "-1", "-f", "yuv4mpegpipe", name], input=data.tobytes(), check=True)
