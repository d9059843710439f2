// Draws what the run sends: picture, tracks, curves; holds the last minute to look back. Nothing here changes the run.
"use strict";
const MINUTE_S = 60, MOST_HELD = 1800, MOST_BYTES = 96e6, TRAIL_S = 6;
const rows = new Map();
const $ = (id) => document.getElementById(id);
const canvas = $("picture"), shift = $("shift");
let held = [], bytes = 0, paused = false, at = -1, chosen = null, drawn = null, bitmap = null, socket = null, pause_ms = 500;
let no_video = false, decoder = null, fed = null, wanted = null, turn = Promise.resolve(), n_chunks = 0, n_decoded = 0;
let source = new URLSearchParams(location.search).get("source");

const colour = (id) => `hsl(${(id * 137.5) % 360} 85% 60%)`;
const fixed = (v, n) => (Number.isFinite(v) ? v.toFixed(n) : "–");
const speed = (t) => Math.hypot(t.vx_px_per_s, t.vy_px_per_s);

/** Asks which sources there are, and shows the choice where there are several. */
async function look_for_sources() {
  const { sources } = await (await fetch("api/sources")).json();
  if (!sources.some((s) => s.source === source)) source = sources[0].source;
  const query = `?source=${encodeURIComponent(source)}`;
  $("api-tracks").href = `api/tracks${query}`;
  $("api-config").href = `api/config${query}`;
  const box = $("sources"), names = sources.map((s) => s.source);
  box.hidden = sources.length < 2;
  $("source").hidden = !box.hidden;
  if (names.join("\n") !== [...box.options].map((o) => o.value).join("\n")) {
    box.replaceChildren(...names.map((name) => new Option(name, name)));
  }
  sources.forEach((s, k) => { box.options[k].text = s.state === "running" ? s.source : `${s.source} (${s.state})`; });
  box.value = source;
}

/** Whether pictures may come as H.264: browsers decode it where the page is by https or on this machine; `?jpeg` behind the page's address leaves it away. */
async function takes_video() {
  if (no_video || !window.VideoDecoder || new URLSearchParams(location.search).has("jpeg")) return false;
  try { return (await VideoDecoder.isConfigSupported({ codec: "avc1.42c028", optimizeForLatency: true })).supported; } catch { return false; }
}

async function connect() {
  let video;
  try { await look_for_sources(); video = await takes_video(); } catch { return again(); }
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/api/view?source=${encodeURIComponent(source)}${video ? "&video=h264" : ""}`);
  socket.binaryType = "arraybuffer";
  const mine = socket;
  socket.onmessage = async (message) => {
    pause_ms = 500;
    try { await take(message.data, video); } catch (error) { console.error(error); }
    // The next comes when this one is drawn: a slow viewer gets fewer.
    const next = () => { if (mine.readyState === WebSocket.OPEN) mine.send("next"); };
    if (document.hidden) setTimeout(next, 1000); else requestAnimationFrame(next);
  };
  const before = n_decoded;
  socket.onclose = () => {
    // One that never brought a picture: the next try takes JPEG.
    if (video && n_decoded === before && held.length > 0) no_video = true;
    if (mine === socket) again();
  };
}

/** Goes on with JPEG: this browser cannot decode what comes. */
function without_video() {
  no_video = true;
  for (const one of held) one.chunk = null;
  if (socket) socket.close();
}

function again() {
  state("away", "no answer; connecting again");
  setTimeout(connect, pause_ms);
  pause_ms = Math.min(2 * pause_ms, 8000);
}

async function take(data, video) {
  const n = new DataView(data).getUint32(0);
  const shot = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, n)));
  const chunk = video ? coded(data, 4 + n) : null;
  const jpeg = !video && data.byteLength > 4 + n ? new Blob([new Uint8Array(data, 4 + n)], { type: "image/jpeg" }) : null;
  const last = held[held.length - 1];
  state(shot.state, shot.why);
  numbers(shot);
  // A word about the state has no frame of its own; a run that was started anew counts from 0.
  if (shot.size_px[0] === 0 && shot.tracks.length === 0 && shot.detections.length === 0 && shot.time_s === 0) return;
  if (last && shot.time_s < last.shot.time_s) { held = []; bytes = 0; at = -1; }
  held.push({ shot, jpeg, chunk, size: jpeg ? jpeg.size : chunk ? chunk.data.byteLength : 0 });
  bytes += held[held.length - 1].size;
  while (held.length > 1 && (held.length > MOST_HELD || bytes > MOST_BYTES || shot.time_s - held[0].shot.time_s > MINUTE_S)) {
    const gone = held.shift();
    bytes -= gone.size;
    at = Math.max(0, at - 1);
  }
  if (!paused) at = held.length - 1;
  shift.max = held.length - 1;
  shift.value = at;
  await show();
}

/** A coded picture behind the text: the name of its coding, of one from which decoding can start, and its bytes. */
function coded(data, from) {
  const n = new DataView(data).getUint8(from), codec = new TextDecoder().decode(new Uint8Array(data, from + 1, n));
  if (data.byteLength === from + 1 + n) return null;
  return { codec, number: n_chunks++, data: new Uint8Array(data, from + 1 + n) };
}

/** The picture of a frame, decoded after those that it needs; one after another, since there is one decoder. */
function decoded(one) {
  turn = turn.catch(() => null).then(() => decode(one));
  return turn;
}

async function decode(one) {
  const k = held.indexOf(one);
  if (k < 0 || !one.chunk) return null;
  let from = k, before = k - 1;
  while (before >= 0 && !held[before].chunk) before--;
  if (!decoder || decoder.state !== "configured" || before < 0 || held[before] !== fed) {
    // Anew from the last picture that needs none before it.
    while (from >= 0 && !held[from].chunk?.codec) from--;
    if (from < 0) return null;
    if (decoder && decoder.state !== "closed") decoder.close();
    decoder = new VideoDecoder({
      output: (frame) => { if (wanted && frame.timestamp === wanted.number) wanted.resolve(frame); else frame.close(); },
      error: (error) => { if (wanted) wanted.reject(error); },
    });
    decoder.configure({ codec: held[from].chunk.codec, optimizeForLatency: true });
  }
  const frame = new Promise((resolve, reject) => {
    wanted = { number: one.chunk.number, resolve, reject };
    setTimeout(() => reject(new Error("the decoder gives nothing")), 3000);
  });
  frame.catch(() => null);
  for (let i = from; i <= k; i++) {
    const chunk = held[i].chunk;
    if (chunk) decoder.decode(new EncodedVideoChunk({ type: chunk.codec ? "key" : "delta", timestamp: chunk.number, data: chunk.data }));
  }
  fed = one;
  const picture = await frame;
  n_decoded++;
  return picture;
}

async function show() {
  const one = held[at];
  if (!one) return;
  if (one !== drawn && (one.jpeg || one.chunk)) {
    let next = null;
    try { next = one.jpeg ? await createImageBitmap(one.jpeg) : await decoded(one); } catch (error) {
      if (one.jpeg) throw error;
      without_video();
    }
    if (next) {
      if (bitmap) bitmap.close();
      bitmap = next;
    }
  }
  drawn = one;
  $("when").value = paused ? `${fixed(one.shot.time_s - held[held.length - 1].shot.time_s, 1)} s` : "now";
  draw(one.shot);
  table(one.shot);
  curves();
}

function state(word, why) {
  $("state").textContent = why ? `${word}: ${why}` : word;
  $("state").className = word;
}

function numbers(s) {
  $("source").textContent = s.source;
  document.title = `${s.source} · boresight live`;
  const rows = [["rate", `${fixed(s.rate_hz, 1)} Hz`], ["latency", s.latency_ms[0] === null ? "–" : `${fixed(s.latency_ms[0], 1)} / ${fixed(s.latency_ms[1], 1)} ms`],
    ["frames", s.arrived], ["dropped", s.dropped, s.dropped > 0], ["mean NIS", fixed(s.mean_nis ?? NaN, 2)], ["viewers", s.viewers]];
  if (s.lost) rows.push(["source lost", s.lost, true]);
  if (s.refused) rows.push(["refused", s.refused, true]);
  if (s.events_dropped) rows.push(["events dropped", s.events_dropped, true]);
  $("numbers").replaceChildren(...rows.map(([name, value, bad]) => {
    const div = document.createElement("div"), dt = document.createElement("dt"), dd = document.createElement("dd");
    dt.textContent = name; dd.textContent = value; dd.className = bad ? "bad" : "";
    div.append(dt, dd);
    return div;
  }));
}

/** Where a track was, oldest first, up to the frame that is shown. */
function history(id, seconds) {
  const until = held[at].shot.time_s, out = [];
  for (let k = at; k >= 0 && until - held[k].shot.time_s <= seconds; k--) {
    const t = held[k].shot.tracks.find((t) => t.track === id);
    if (t) out.push([held[k].shot.time_s, t]);
  }
  return out.reverse();
}

/** Size of the frame in its own pixels; of detections alone, what they and the tracks span. */
function extent(s) {
  if (s.size_px[0] > 0) return s.size_px;
  if (bitmap && drawn && held.some((h) => h.size)) return held.findLast((h) => h.size).shot.size_px;
  const all = held.flatMap((h) => [...h.shot.detections, ...h.shot.tracks.map((t) => [t.x_px, t.y_px])]);
  const most = (k) => all.reduce((m, p) => Math.max(m, p[k]), 1) * 1.05;
  return [most(0), most(1)];
}

function draw(s) {
  const [w, h] = extent(s), room = canvas.parentElement.clientWidth - 20 || 640, ratio = window.devicePixelRatio || 1;
  const scale = Math.min(room / w, (window.innerHeight * 0.78) / h) * ratio;
  canvas.width = Math.round(w * scale); canvas.height = Math.round(h * scale);
  canvas.style.width = `${canvas.width / ratio}px`;
  const g = canvas.getContext("2d");
  g.imageSmoothingEnabled = scale < 4;
  // A video's sides are even: what an odd one has beyond the frame lies beyond the canvas.
  const over = (side, n) => (side === n + 1 ? scale : 0);
  if (bitmap) g.drawImage(bitmap, 0, 0, canvas.width + over(bitmap.displayWidth, w), canvas.height + over(bitmap.displayHeight, h));
  // The centre of the top-left pixel is (0, 0).
  g.setTransform(scale, 0, 0, scale, scale / 2, scale / 2);
  const px = ratio / scale;
  if ($("dots").checked) {
    g.fillStyle = "#ffd54d";
    for (const [x, y] of s.detections) { g.beginPath(); g.arc(x, y, 2 * px, 0, 7); g.fill(); }
  }
  g.font = `600 ${12 * px}px system-ui, sans-serif`;
  for (const t of s.tracks) {
    g.strokeStyle = g.fillStyle = colour(t.track);
    g.lineWidth = (t.track === chosen ? 3 : 1.5) * px;
    g.setLineDash(t.status === "coasting" ? [4 * px, 4 * px] : []);
    if ($("trails").checked) {
      g.globalAlpha = 0.7;
      g.beginPath();
      for (const [, p] of history(t.track, TRAIL_S)) g.lineTo(p.x_px, p.y_px);
      g.stroke();
      g.globalAlpha = 1;
    }
    const bw = Math.max(t.width_px, 8 * px), bh = Math.max(t.height_px, 8 * px);
    if ($("boxes").checked) g.strokeRect(t.x_px - bw / 2, t.y_px - bh / 2, bw, bh);
    if ($("ellipses").checked) {
      const [a, b, angle] = axes(t.cov[0], t.cov[2], t.cov[7]);
      g.beginPath(); g.ellipse(t.x_px, t.y_px, 3 * a, 3 * b, angle, 0, 2 * Math.PI); g.stroke();
    }
    g.setLineDash([]);
    const top = t.y_px - bh / 2 - 4 * px, text = String(t.track);
    g.lineWidth = 3 * px; g.strokeStyle = "rgb(0 0 0 / 70%)";
    const y = top < 12 * px ? t.y_px + bh / 2 + 14 * px : top;
    g.strokeText(text, t.x_px - bw / 2, y); g.fillText(text, t.x_px - bw / 2, y);
  }
}

/** Half axes (one standard deviation) and angle of a covariance. */
function axes(xx, xy, yy) {
  const mean = (xx + yy) / 2, d = Math.hypot((xx - yy) / 2, xy);
  return [Math.sqrt(Math.max(mean + d, 0)), Math.sqrt(Math.max(mean - d, 0)), Math.atan2(2 * xy, xx - yy) / 2];
}

function table(s) {
  $("none").hidden = s.tracks.length > 0;
  const born = new Map();
  for (const h of held) for (const t of h.shot.tracks) if (!born.has(t.track)) born.set(t.track, h.shot.time_s);
  const shown = s.tracks.slice(0, 100), ids = new Set(shown.map((t) => t.track));
  // Rows stay where they are, so that a click that lasts longer than a frame finds the one it began on.
  for (const [id, row] of rows) if (!ids.has(id)) { row.remove(); rows.delete(id); }
  shown.forEach((t, k) => {
    const row = rows.get(t.track) ?? new_row(t.track);
    if ($("tracks").children[k] !== row) $("tracks").insertBefore(row, $("tracks").children[k] ?? null);
    const texts = [`${fixed(t.x_px, 1)}, ${fixed(t.y_px, 1)}`, fixed(speed(t), 1), fixed(Math.sqrt((t.cov[0] + t.cov[7]) / 2), 2),
      fixed(t.nis ?? NaN, 1), fixed(s.time_s - born.get(t.track), 0)];
    texts.forEach((text, i) => { if (row.children[i + 1].textContent !== text) row.children[i + 1].textContent = text; });
    const name = `${t.status}${t.track === chosen ? " chosen" : ""}`;
    if (row.className !== name) row.className = name;
  });
}

function new_row(id) {
  const row = document.createElement("tr"), swatch = document.createElement("span");
  swatch.className = "swatch"; swatch.style.background = colour(id);
  for (let k = 0; k < 6; k++) row.append(document.createElement("td"));
  row.firstChild.append(swatch, String(id));
  row.onclick = () => choose(id);
  rows.set(id, row);
  return row;
}

function choose(id) { chosen = id === chosen ? null : id; show(); }

function curves() {
  $("curves").hidden = chosen === null;
  if (chosen === null) return;
  const line = history(chosen, MINUTE_S);
  $("chosen").textContent = `Track ${chosen}${line.length ? "" : " (over)"}`;
  const std = (k) => (t) => 3 * Math.sqrt(t.cov[k]);
  curve("curve-x", line, (t) => t.x_px, std(0));
  curve("curve-y", line, (t) => t.y_px, std(7));
  curve("curve-speed", line, speed, null);
  curve("curve-nis", line, (t) => t.nis, null, [2, 9.21]);
}

function curve(id, line, value, band, marks = []) {
  const c = $(id), ratio = window.devicePixelRatio || 1, style = getComputedStyle(document.documentElement);
  const w = (c.width = c.clientWidth * ratio), h = (c.height = c.clientHeight * ratio), g = c.getContext("2d");
  const points = line.map(([time, t]) => [time, value(t), band ? band(t) : 0]).filter((p) => Number.isFinite(p[1]));
  if (points.length < 2) return;
  let low = Math.min(...points.map((p) => p[1] - p[2]), ...marks), high = Math.max(...points.map((p) => p[1] + p[2]), ...marks);
  if (marks.length) { low = 0; high = Math.min(high, 30); }
  const left = 40 * ratio, span = Math.max(high - low, 1e-6), from = points[0][0], long = Math.max(points[points.length - 1][0] - from, 1e-6);
  const x = (t) => left + ((t - from) / long) * (w - left - 4 * ratio), y = (v) => h - 6 * ratio - ((v - low) / span) * (h - 14 * ratio);
  g.font = `${11 * ratio}px system-ui, sans-serif`;
  g.fillStyle = style.getPropertyValue("--faint");
  g.fillText(fixed(high, high < 100 ? 1 : 0), 0, y(high) + 8 * ratio);
  g.fillText(fixed(low, high < 100 ? 1 : 0), 0, y(low));
  g.strokeStyle = style.getPropertyValue("--line");
  for (const mark of marks) { g.beginPath(); g.moveTo(left, y(mark)); g.lineTo(w, y(mark)); g.stroke(); }
  if (band) {
    g.globalAlpha = 0.25; g.fillStyle = colour(chosen);
    g.beginPath();
    points.forEach((p) => g.lineTo(x(p[0]), y(p[1] + p[2])));
    points.toReversed().forEach((p) => g.lineTo(x(p[0]), y(p[1] - p[2])));
    g.fill(); g.globalAlpha = 1;
  }
  g.strokeStyle = colour(chosen); g.lineWidth = 1.5 * ratio;
  g.beginPath();
  points.forEach((p) => g.lineTo(x(p[0]), y(Math.min(p[1], high))));
  g.stroke();
}

function pause(on) {
  paused = on;
  $("pause").textContent = on ? "Go on" : "Pause";
  if (!on) at = held.length - 1;
  show();
}
function step(by) { pause(true); at = Math.min(Math.max(at + by, 0), held.length - 1); shift.value = at; show(); }
function next(by) {
  const ids = held[at]?.shot.tracks.map((t) => t.track) ?? [];
  if (ids.length) { chosen = ids[(ids.indexOf(chosen) + by + ids.length) % ids.length]; show(); }
}
function snapshot() {
  const link = document.createElement("a");
  link.download = `boresight-${drawn?.shot.frame ?? 0}.png`;
  link.href = canvas.toDataURL("image/png");
  link.click();
}

canvas.onclick = (event) => {
  if (!held[at]) return;
  const box = canvas.getBoundingClientRect(), [w] = extent(held[at].shot);
  const scale = box.width / w, x = (event.clientX - box.left) / scale - 0.5, y = (event.clientY - box.top) / scale - 0.5;
  const far = (t) => Math.hypot(t.x_px - x, t.y_px - y) - Math.max(t.width_px, t.height_px) / 2;
  const near = [...held[at].shot.tracks].sort((a, b) => far(a) - far(b))[0];
  if (near && far(near) * scale < 30) choose(near.track);
};
// What is held belongs to one source: the page of another begins anew.
$("sources").onchange = (event) => { location.search = `?source=${encodeURIComponent(event.target.value)}`; };
setInterval(() => { if (!$("sources").hidden && !document.hidden) look_for_sources().catch(() => {}); }, 3000);
$("pause").onclick = () => pause(!paused);
$("snapshot").onclick = snapshot;
shift.oninput = () => { pause(true); at = Number(shift.value); show(); };
for (const id of ["boxes", "trails", "ellipses", "dots"]) $(id).onchange = show;
addEventListener("resize", show);
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const keys = { " ": () => pause(!paused), ArrowLeft: () => step(-1), ArrowRight: () => step(1), ArrowDown: () => next(1), ArrowUp: () => next(-1), s: snapshot };
  if (keys[event.key] && !(event.target instanceof HTMLButtonElement && event.key === " ") && !(event.target instanceof HTMLSelectElement) && !event.target.closest?.("#tuning")) { event.preventDefault(); keys[event.key](); }
});
connect();
