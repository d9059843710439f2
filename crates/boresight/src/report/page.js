"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const NS = "http://www.w3.org/2000/svg";
  const node = (name, attributes = {}, parent = null, text = "") => {
    const n = document.createElementNS(NS, name);
    for (const k in attributes) n.setAttribute(k, attributes[k]);
    if (text !== "") n.textContent = text;
    if (parent) parent.appendChild(n);
    return n;
  };
  const ok = v => v !== null && Number.isFinite(v);
  const show = (v, digits = 4) => !ok(v) ? "none" : v === 0 ? "0" : String(Number(v.toPrecision(digits)));

  // Steps of 1, 2 or 5 times a power of ten, about `n` of them.
  const ticks = (lo, hi, n, least = 1) => {
    const raw = (hi - lo) / n, power = 10 ** Math.floor(Math.log10(raw)), steps = [1, 2, 5, 10].map(m => m * power);
    let i = steps.findIndex(s => s >= raw);
    // One tick gives no scale: a finer step then.
    while (i > 0 && Math.floor(hi / steps[i]) - Math.ceil(lo / steps[i]) + 1 < least) i--;
    const step = steps[i], out = [];
    for (let k = Math.ceil(lo / step - 1e-9); k * step <= hi + step * 1e-9; k++) out.push(Number((k * step).toPrecision(12)));
    return out;
  };

  // Index of the time nearest to `at`.
  const nearest = (t, at) => {
    let lo = 0, hi = t.length - 1;
    while (hi - lo > 1) { const mid = (lo + hi) >> 1; if (t[mid] < at) lo = mid; else hi = mid; }
    return Math.abs(t[lo] - at) <= Math.abs(t[hi] - at) ? lo : hi;
  };

  // Charts that share time, pointer and zoom.
  class Group {
    constructor() { this.charts = []; this.zoom = null; this.at = null; this.onpoint = () => {}; }
    set(t, shades = []) { this.t = t; this.shades = shades; this.zoom = null; this.at = null; }
    range() {
      if (this.zoom) return this.zoom;
      const lo = this.t[0], hi = this.t[this.t.length - 1];
      return hi > lo ? [lo, hi] : [lo - 0.5, lo + 0.5];
    }
    point(i) { this.at = i; this.charts.forEach(c => c.point(i)); this.onpoint(i); }
    draw() { this.charts.forEach(c => c.draw()); if (this.at !== null) this.point(this.at); }
  }

  class Chart {
    constructor(host, group, titled, read) {
      // Titles and readings speak of pixels; a map counts metres.
      const inUnit = text => data.unit === "px" ? text : text.replaceAll("px", data.unit), title = inUnit(titled);
      this.group = group; this.reading = i => inUnit(read(i)); this.spec = null;
      const figure = document.createElement("figure"), caption = document.createElement("figcaption");
      caption.append(title);
      this.out = document.createElement("span"); this.out.className = "reading"; caption.append(this.out);
      this.svg = node("svg", { class: "chart", role: "img", tabindex: "0", "aria-label": title + ": use the arrow keys to read values" });
      figure.append(caption, this.svg); host.append(figure); group.charts.push(this);
      const time = e => {
        const box = this.svg.getBoundingClientRect(), [lo, hi] = this.group.range();
        const share = Math.min(1, Math.max(0, (e.clientX - box.left - this.left) / this.w));
        return lo + share * (hi - lo);
      };
      let from = null;
      this.svg.addEventListener("pointerdown", e => { from = time(e); this.svg.setPointerCapture(e.pointerId); });
      this.svg.addEventListener("pointermove", e => {
        if (!this.group.t.length) return;
        const now = time(e);
        this.group.point(nearest(this.group.t, now));
        if (from !== null) this.mark(from, now);
      });
      this.svg.addEventListener("pointerup", e => {
        const to = time(e), [lo, hi] = this.group.range();
        if (from !== null && Math.abs(to - from) > (hi - lo) * 0.02) this.group.zoom = [Math.min(from, to), Math.max(from, to)];
        from = null; this.group.draw();
      });
      this.svg.addEventListener("pointercancel", () => { from = null; this.group.draw(); });
      this.svg.addEventListener("dblclick", () => { this.group.zoom = null; this.group.draw(); });
      this.svg.addEventListener("keydown", e => {
        const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
        if (e.key === "Escape") { this.group.zoom = null; this.group.draw(); }
        if (!step || !this.group.t.length) return;
        const start = this.group.at === null ? 0 : this.group.at + step;
        this.group.point(Math.min(this.group.t.length - 1, Math.max(0, start))); e.preventDefault();
      });
    }

    // spec: { lines: [{v, cls, dots}], bands: [{lo, hi}], rules: [{y, cls, text}], zero }
    set(spec) { this.spec = spec; }

    draw() {
      const svg = this.svg, spec = this.spec, t = this.group.t;
      svg.replaceChildren(); this.cross = null; this.out.textContent = "";
      const W = Math.max(240, svg.clientWidth || 480), H = 200;
      svg.setAttribute("viewBox", `0 0 ${W} ${H}`);
      if (!spec || !t.length) return;
      const [t0, t1] = this.group.range();
      let lo = Infinity, hi = -Infinity;
      const see = v => { if (ok(v)) { lo = Math.min(lo, v); hi = Math.max(hi, v); } };
      t.forEach((time, i) => {
        if (time < t0 || time > t1) return;
        (spec.lines || []).forEach(l => see(l.v[i]));
        (spec.bands || []).forEach(b => { see(b.lo[i]); see(b.hi[i]); });
      });
      (spec.rules || []).forEach(r => see(r.y));
      if (spec.zero) see(0);
      if (!(hi >= lo)) { node("text", { x: W / 2, y: H / 2, "text-anchor": "middle" }, svg, "no values"); return; }
      if (hi === lo) { const d = Math.abs(hi) * 0.05 || 0.5; lo -= d; hi += d; }
      this.span = hi - lo;
      const other = spec.twin && this.group.charts.find(c => c !== this && c.spec && c.spec.twin === spec.twin);
      const span = other ? Math.max(this.span, other.wanted(t0, t1)) : this.span, grow = (span - this.span) / 2;
      lo -= grow; hi += grow;
      const pad = (hi - lo) * 0.05; if (!(spec.zero && lo === 0)) lo -= pad; hi += pad;
      const yTicks = ticks(lo, hi, 4, 3), labels = yTicks.map(v => show(v, 6));
      this.left = Math.max(34, 10 + 6.4 * Math.max(...labels.map(s => s.length)));
      this.w = W - this.left - 10; this.top = 8; this.h = H - 36;
      const X = v => this.left + (v - t0) / (t1 - t0) * this.w, Y = v => this.top + (hi - v) / (hi - lo) * this.h;
      this.X = X;
      yTicks.forEach((v, i) => {
        node("line", { class: "grid", x1: this.left, x2: this.left + this.w, y1: Y(v), y2: Y(v) }, svg);
        node("text", { x: this.left - 5, y: Y(v) + 4, "text-anchor": "end" }, svg, labels[i]);
      });
      ticks(t0, t1, Math.max(2, Math.floor(this.w / 90))).forEach(v => {
        node("line", { class: "axis", x1: X(v), x2: X(v), y1: this.top + this.h, y2: this.top + this.h + 4 }, svg);
        node("text", { x: X(v), y: this.top + this.h + 16, "text-anchor": "middle" }, svg, show(v, 8));
      });
      node("text", { x: this.left + this.w, y: H - 2, "text-anchor": "end" }, svg, "time, s");
      const clip = "clip" + Math.random().toString(36).slice(2);
      node("rect", { x: this.left, y: this.top, width: this.w, height: this.h }, node("clipPath", { id: clip }, svg));
      const plot = node("g", { "clip-path": `url(#${clip})` }, svg);
      this.group.shades.forEach(([a, b]) => {
        if (b >= t0 && a <= t1) node("rect", { class: "coast", x: X(a), width: Math.max(1, X(b) - X(a)), y: this.top, height: this.h }, plot);
      });
      // A gap in the values is a gap in the curve.
      const runs = good => { const out = []; let run = null; t.forEach((_, i) => { if (good(i)) { if (!run) out.push(run = []); run.push(i); } else run = null; }); return out; };
      const P = (i, v) => X(t[i]).toFixed(1) + "," + Y(v).toFixed(1);
      (spec.bands || []).forEach(b => runs(i => ok(b.lo[i]) && ok(b.hi[i])).forEach(run => {
        const up = run.map(i => P(i, b.hi[i])), down = run.map(i => P(i, b.lo[i])).reverse();
        if (run.length === 1) { const i = run[0]; node("rect", { class: "area", x: X(t[i]) - 1.5, width: 3, y: Y(b.hi[i]), height: Math.max(0, Y(b.lo[i]) - Y(b.hi[i])) }, plot); }
        else node("polygon", { class: "area", points: up.concat(down).join(" ") }, plot);
      }));
      (spec.rules || []).forEach(r => {
        node("line", { class: "line dash " + r.cls, x1: this.left, x2: this.left + this.w, y1: Y(r.y), y2: Y(r.y) }, plot);
        if (r.text) node("text", { x: this.left + this.w - 4, y: Y(r.y) - 4, "text-anchor": "end" }, svg, r.text);
      });
      (spec.lines || []).forEach(l => {
        const dots = () => t.forEach((time, i) => { if (ok(l.v[i]) && time >= t0 && time <= t1) node("circle", { class: "dots", cx: X(time), cy: Y(l.v[i]), r: 1.7 }, plot); });
        if (l.dots) { dots(); return; }
        runs(i => ok(l.v[i])).forEach(run => {
          if (run.length === 1) node("circle", { class: "dots", cx: X(t[run[0]]), cy: Y(l.v[run[0]]), r: 1.7 }, plot);
          else node("polyline", { class: "line " + l.cls, points: run.map(i => P(i, l.v[i])).join(" ") }, plot);
        });
      });
      node("line", { class: "axis", x1: this.left, x2: this.left + this.w, y1: this.top + this.h, y2: this.top + this.h }, svg);
      this.cross = node("line", { class: "cross", y1: this.top, y2: this.top + this.h, visibility: "hidden" }, svg);
      this.brush = node("rect", { class: "brush", y: this.top, height: this.h, visibility: "hidden" }, svg);
    }

    // The span of the values in a stretch of time.
    wanted(t0, t1) {
      let lo = Infinity, hi = -Infinity;
      const see = v => { if (ok(v)) { lo = Math.min(lo, v); hi = Math.max(hi, v); } };
      this.group.t.forEach((time, i) => {
        if (time < t0 || time > t1) return;
        (this.spec.lines || []).forEach(l => see(l.v[i]));
        (this.spec.bands || []).forEach(b => { see(b.lo[i]); see(b.hi[i]); });
      });
      (this.spec.rules || []).forEach(r => see(r.y));
      return hi > lo ? hi - lo : 0;
    }

    mark(a, b) {
      if (!this.brush) return;
      const x = this.X(Math.min(a, b)), w = this.X(Math.max(a, b)) - x;
      for (const [k, v] of [["x", x], ["width", w], ["visibility", "visible"]]) this.brush.setAttribute(k, v);
    }

    point(i) {
      if (!this.cross) return;
      const x = this.X(this.group.t[i]), inside = x >= this.left - 1 && x <= this.left + this.w + 1;
      this.cross.setAttribute("visibility", inside ? "visible" : "hidden");
      this.cross.setAttribute("x1", x); this.cross.setAttribute("x2", x);
      this.out.textContent = this.reading(i);
    }
  }

  const groups = [];
  const counts = data.counts, host = document.getElementById("count-charts");
  if (host && counts.t.length) {
    const g = new Group(), when = i => `frame ${counts.f[i]}, ${show(counts.t[i], 7)} s`;
    g.set(counts.t); groups.push(g);
    const detections = new Chart(host, g, "Detections per frame", i => `${when(i)}: ${show(counts.n[i])}${counts.per > 1 ? ", most " + counts.most[i] : ""}`);
    detections.set({ lines: [{ v: counts.n, cls: "blue" }].concat(counts.per > 1 ? [{ v: counts.most, cls: "grey" }] : []), zero: true });
    const tracks = new Chart(host, g, "Tracks", i => `${when(i)}: ${show(counts.c[i])} confirmed, ${show(counts.o[i])} coasting, ${show(counts.n0[i])} tentative`);
    tracks.set({ lines: [{ v: counts.n0, cls: "grey dash" }, { v: counts.o, cls: "orange" }, { v: counts.c, cls: "blue" }], zero: true });
  }

  const select = document.getElementById("choose"), charts = document.getElementById("track-charts");
  if (select && data.tracks.length) {
    const g = new Group(); groups.push(g);
    let track = null;
    const names = { t: "tentative", c: "confirmed", o: "coasting" };
    const pm = (i, v, s, unit) => `${show(track[v][i], 6)} ± ${show(2 * track[s][i], 3)} ${unit}`;
    const wide = (v, s, sign) => track[v].map((m, i) => ok(m) && ok(track[s][i]) ? m + sign * 2 * track[s][i] : null);
    const around = (s, sign) => track[s].map(v => ok(v) ? sign * 2 * v : null);
    // x and y of one thing are drawn on axes of one span.
    const twin = title => title.replace(/^(Innovation in )?[xy]/, "$1");
    const state = (title, v, s, unit) => ({ chart: new Chart(charts, g, title, i => pm(i, v, s, unit)),
      spec: () => ({ bands: [{ lo: wide(v, s, -1), hi: wide(v, s, 1) }], lines: [{ v: track[v], cls: "own" }], twin: twin(title) }) });
    const sigma = (title, a, b, unit) => ({ chart: new Chart(charts, g, title, i => `x ${show(track[a][i], 3)}, y ${show(track[b][i], 3)} ${unit}`),
      spec: () => ({ lines: [{ v: track[a], cls: "blue broad" }, { v: track[b], cls: "orange dash" }], zero: true }) });
    const innovation = (title, v, s) => ({ chart: new Chart(charts, g, title, i => ok(track[v][i]) ? `${show(track[v][i])}, bounds ± ${show(2 * track[s][i], 3)} px` : "no update"),
      spec: () => ({ bands: [{ lo: around(s, -1), hi: around(s, 1) }], lines: [{ v: track[v], dots: true }], rules: [{ y: 0, cls: "grey" }], twin: twin(title) }) });
    const panels = [
      state("x, px (band ± 2σ)", "x", "sx", "px"), state("y, px (band ± 2σ)", "y", "sy", "px"),
      state("x velocity, px/s (band ± 2σ)", "vx", "svx", "px/s"), state("y velocity, px/s (band ± 2σ)", "vy", "svy", "px/s"),
      sigma("Standard deviation of position, px", "sx", "sy", "px"), sigma("Standard deviation of velocity, px/s", "svx", "svy", "px/s"),
      innovation("Innovation in x, px (band ± 2√S)", "ix", "rx"), innovation("Innovation in y, px (band ± 2√S)", "iy", "ry"),
      { chart: new Chart(charts, g, "NIS, normalised innovation squared", i => ok(track.nis[i]) ? show(track.nis[i], 4) : "no update"),
        spec: () => ({ lines: [{ v: track.nis, dots: true }], rules: [{ y: 5.991, cls: "orange", text: "95 %: 5.99" }, { y: 9.210, cls: "grey", text: "99 %: 9.21" }], zero: true }) },
    ];
    const line = document.getElementById("reading"), view = document.getElementById("view"), spot = document.getElementById("spot");
    g.onpoint = i => {
      line.textContent = `frame ${track.f[i]}, ${track.t[i].toFixed(2)} s, ${names[track.s[i]]}`;
      if (spot) { spot.setAttribute("cx", track.px[i]); spot.setAttribute("cy", track.py[i]); spot.setAttribute("visibility", "visible"); }
    };
    const choose = id => {
      track = data.tracks.find(k => String(k.id) === String(id)) || data.tracks[0];
      select.value = String(track.id);
      charts.style.setProperty("--track", track.colour); document.getElementById("swatch").style.background = track.colour;
      document.querySelectorAll("#track-charts, #track-charts + .key").forEach(n => n.style.setProperty("--track", track.colour));
      const shades = [];
      for (let i = 0; i < track.t.length; i++) if (track.s[i] === "o") {
        const a = i > 0 ? track.t[i - 1] : track.t[i], last = shades[shades.length - 1];
        if (last && last[1] >= a) last[1] = track.t[i]; else shades.push([a, track.t[i]]);
      }
      g.set(track.t, shades);
      panels.forEach(p => p.chart.set(p.spec()));
      g.draw();
      line.textContent = "";
      if (spot) spot.setAttribute("visibility", "hidden");
      document.querySelectorAll(".chosen").forEach(n => n.classList.remove("chosen"));
      document.querySelectorAll(`[data-track="${track.id}"]`).forEach(n => { n.classList.add("chosen"); if (n.tagName === "polyline") n.parentNode.appendChild(n); });
      const verdict = document.getElementById("verdict");
      if (verdict) verdict.textContent = track.words + (track.k > 1 ? ` Drawn: every ${track.k}th frame.` : "");
    };
    select.addEventListener("change", () => choose(select.value));
    document.getElementById("whole").addEventListener("click", () => { g.zoom = null; g.draw(); });
    const step = d => { const at = data.tracks.indexOf(track) + d; if (at >= 0 && at < data.tracks.length) choose(data.tracks[at].id); };
    document.getElementById("before").addEventListener("click", () => step(-1));
    document.getElementById("after").addEventListener("click", () => step(1));
    document.addEventListener("click", e => {
      const hit = e.target.closest && e.target.closest("[data-track]");
      if (hit && data.tracks.some(k => String(k.id) === hit.dataset.track)) choose(hit.dataset.track);
    });
    // Tags keep their size on the screen whatever the frame's size.
    const scale = () => { if (!view) return; const px = view.viewBox.baseVal.width / Math.max(1, Math.min(view.clientWidth, view.clientHeight * view.viewBox.baseVal.width / view.viewBox.baseVal.height));
      view.querySelectorAll(".tag").forEach(n => { n.style.fontSize = 12 * px + "px"; n.style.strokeWidth = 2.5 * px + "px"; });
      view.querySelectorAll(".start").forEach(n => n.setAttribute("r", 2.6 * px)); if (spot) spot.setAttribute("r", 7 * px); };
    choose(data.tracks[0].id); scale();
    window.addEventListener("resize", scale);
  }
  document.querySelectorAll("[data-show]").forEach(box => {
    const set = () => document.querySelectorAll("#view, #tracks").forEach(n => n.classList.toggle("hide-" + box.dataset.show, !box.checked));
    box.addEventListener("change", set); set();
  });
  const drawAll = () => groups.forEach(g => g.draw());
  drawAll();
  let waiting = 0;
  window.addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(drawAll, 120); });
})();
