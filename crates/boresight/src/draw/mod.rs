//! Drawing on frames: boxes, labels, trails, ellipses; and annotated video.
