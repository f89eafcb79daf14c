// The plan view: tracks, vehicles, fences, the pair looked at, its Ds circle and its evading circles.

const INK = "#222", FAINT = "#d8dde3", ALARM = "#b3261e", FENCE = "#8a4f7d";

class PlanView {
  constructor(canvas, plants, dSafe, mode, fences) {
    Object.assign(this, { canvas, plants, dSafe, mode, fences, centre: [0, 0], scale: 1, near: mode === "close" });
    this.context = canvas.getContext("2d");
    this.still = document.createElement("canvas");
    this.stillKey = "";
    this.bounds = this.boundsOf();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  boundsOf() {
    let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const plant of this.plants)
      for (let v = 0; v < plant.count; v++)
        for (const [x, y] of [[plant.tracks.x[v], plant.tracks.y[v]]])
          for (let k = 0; k < x.length; k++) {
            west = Math.min(west, x[k]); east = Math.max(east, x[k]);
            south = Math.min(south, y[k]); north = Math.max(north, y[k]);
          }
    const r = (fence) => fence.radius || 0;
    for (const fence of this.fences)
      for (const [x, y] of fence.corners || [fence.centre]) {
        west = Math.min(west, x - r(fence)); east = Math.max(east, x + r(fence));
        south = Math.min(south, y - r(fence)); north = Math.max(north, y + r(fence));
      }
    return { west, east, south, north };
  }

  resize() {
    const ratio = window.devicePixelRatio || 1, box = this.canvas.getBoundingClientRect();
    this.width = Math.max(50, box.width);
    this.height = Math.max(50, box.height);
    for (const surface of [this.canvas, this.still]) {
      surface.width = Math.round(this.width * ratio);
      surface.height = Math.round(this.height * ratio);
    }
    this.ratio = ratio;
    this.stillKey = "";
    if (this.last) this.draw(...this.last);
  }

  px(x, y) {
    return [this.width / 2 + (x - this.centre[0]) * this.scale, this.height / 2 - (y - this.centre[1]) * this.scale];
  }

  fit(west, east, south, north, least) {
    const wide = Math.max(east - west, least), high = Math.max(north - south, least);
    this.centre = [(west + east) / 2, (south + north) / 2];
    this.scale = 0.86 * Math.min(this.width / wide, this.height / high);
  }

  // Where to look: at everything, or at the pair, with its evading circles or close up.
  look(t, pair) {
    const shown = this.plants.filter((p) => p.shown);
    if (this.mode === "free" || !shown.length) return;
    if (this.mode === "all" || !pair) {
      const b = this.bounds;
      return this.fit(b.west, b.east, b.south, b.north, 20 * this.dSafe);
    }
    let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
    const include = (x, y, r) => {
      west = Math.min(west, x - r); east = Math.max(east, x + r);
      south = Math.min(south, y - r); north = Math.max(north, y + r);
    };
    for (const plant of shown) {
      const { poses, gammas, approach } = this.pairOf(plant, t, pair(plant, t));
      poses.forEach((pose, k) => {
        include(pose.x, pose.y, 1.6 * this.dSafe);
        const round = this.mode === "circles" && gammas && circle(pose, gammas[k]);
        if (round) include(round.x, round.y, round.r);
      });
      if (this.mode === "circles" && approach) for (const p of [approach.a, approach.b]) include(p.x, p.y, this.dSafe);
    }
    this.fit(west, east, south, north, 6 * this.dSafe);
  }

  pairOf(plant, t, [i, j]) {
    const poses = [plant.pose(i, t), plant.pose(j, t)], gammas = plant.manoeuvre(i, j);
    return { poses, gammas, approach: gammas && closestApproach(...poses, gammas) };
  }

  draw(t, pair) {
    this.last = [t, pair];
    this.look(t, pair);
    const c = this.context;
    this.drawStill();
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.drawImage(this.still, 0, 0);
    c.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    this.plants.filter((p) => p.shown).forEach((plant, line) => {
      this.tail(plant, t);
      const looked = pair ? pair(plant, t) : null;
      if (looked) this.pair(plant, t, looked, line);
      this.vehicles(plant, t, looked || []);
    });
  }

  // Grid and whole tracks change only with the view: drawn once, kept as a picture.
  drawStill() {
    const key = [this.centre, this.scale, this.plants.map((p) => p.shown)].join();
    if (key === this.stillKey) return;
    this.stillKey = key;
    const c = this.still.getContext("2d");
    c.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    c.fillStyle = "#fff";
    c.fillRect(0, 0, this.width, this.height);
    this.grid(c);
    for (const fence of this.fences) this.fence(c, fence);
    for (const plant of this.plants.filter((p) => p.shown)) {
      c.strokeStyle = plant.color;
      c.globalAlpha = 0.3;
      c.lineWidth = 1;
      c.setLineDash(plant.dashed ? [6, 4] : []);
      for (let v = 0; v < plant.count; v++) this.track(c, plant, v, 0, plant.t.length - 1);
      c.globalAlpha = 1;
      c.setLineDash([]);
    }
  }

  grid(c) {
    const rough = 90 / this.scale, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
    const half = [this.width / 2 / this.scale, this.height / 2 / this.scale];
    const digits = Math.max(0, -Math.floor(Math.log10(step)));
    c.strokeStyle = FAINT;
    c.fillStyle = "#5a6472";
    c.lineWidth = 0.6;
    c.font = "11px system-ui, sans-serif";
    c.beginPath();
    for (let x = Math.ceil((this.centre[0] - half[0]) / step) * step; x <= this.centre[0] + half[0]; x += step) {
      const [left] = this.px(x, 0);
      c.moveTo(left, 0);
      c.lineTo(left, this.height);
      c.fillText(x.toFixed(digits), left + 3, this.height - 5);
    }
    for (let y = Math.ceil((this.centre[1] - half[1]) / step) * step; y <= this.centre[1] + half[1]; y += step) {
      const top = this.px(0, y)[1];
      c.moveTo(0, top);
      c.lineTo(this.width, top);
      if (top < this.height - 30 && top > 12) c.fillText(y.toFixed(digits), 3, top - 3);
    }
    c.stroke();
    if (this.near) return;
    c.fillText("east [m]", this.width - 52, this.height - 20);
    c.fillText("north [m]", 3, 12);
  }

  // Areas to stay out of are tinted; the margin beside a circle is dashed.
  fence(c, fence) {
    c.strokeStyle = FENCE;
    c.fillStyle = FENCE + "30";
    c.lineWidth = 1.4;
    c.beginPath();
    if (fence.corners) fence.corners.forEach(([x, y], k) => (k ? c.lineTo(...this.px(x, y)) : c.moveTo(...this.px(x, y))));
    else c.arc(...this.px(...fence.centre), fence.radius * this.scale, 0, 2 * Math.PI);
    c.closePath();
    if (!fence.inside) c.fill();
    c.stroke();
    if (fence.centre && fence.margin) {
      c.beginPath();
      c.setLineDash([3, 3]);
      c.arc(...this.px(...fence.centre), (fence.radius + fence.margin) * this.scale, 0, 2 * Math.PI);
      c.stroke();
      c.setLineDash([]);
    }
    const [left, top] = this.px(...(fence.corners ? fence.corners[0] : fence.centre));
    c.fillStyle = FENCE;
    c.font = "11px system-ui, sans-serif";
    c.fillText(fence.title, left + 4, top - 4);
  }

  track(c, plant, v, from, to) {
    const x = plant.tracks.x[v], y = plant.tracks.y[v];
    c.beginPath();
    let [lastX, lastY] = [NaN, NaN];
    for (let k = from; k <= to; k++) {
      const [left, top] = this.px(x[k], y[k]);
      if (k > from && k < to && Math.abs(left - lastX) < 1.5 && Math.abs(top - lastY) < 1.5) continue;
      if (k === from) c.moveTo(left, top);
      else c.lineTo(left, top);
      [lastX, lastY] = [left, top];
    }
    c.stroke();
  }

  // The last five seconds, stronger.
  tail(plant, t) {
    const c = this.context, from = plant.frame(t - 5), to = plant.frame(t);
    c.strokeStyle = plant.color;
    c.lineWidth = 1.8;
    c.setLineDash(plant.dashed ? [6, 4] : []);
    for (let v = 0; v < plant.count; v++) this.track(c, plant, v, from, to);
    c.setLineDash([]);
  }

  vehicles(plant, t, looked) {
    const c = this.context;
    for (let v = 1; v <= plant.count; v++) {
      if (plant.left[v - 1] !== null && t >= plant.left[v - 1]) continue;
      const pose = plant.pose(v, t), [left, top] = this.px(pose.x, pose.y), marked = looked.includes(v);
      if (left < -20 || top < -20 || left > this.width + 20 || top > this.height + 20) continue;
      const size = marked ? 10 : 7;
      c.save();
      c.translate(left, top);
      c.rotate(-pose.theta);
      c.beginPath();
      c.moveTo(size, 0);
      c.lineTo(-0.8 * size, 0.62 * size);
      c.lineTo(-0.4 * size, 0);
      c.lineTo(-0.8 * size, -0.62 * size);
      c.closePath();
      // Dashed plants are solid shapes, the others hollow: told apart without colour.
      c.fillStyle = plant.dashed ? plant.color : "#fff";
      c.strokeStyle = marked ? INK : plant.color;
      c.lineWidth = marked ? 1.8 : 1.2;
      c.fill();
      c.stroke();
      c.restore();
      // Where many stand close together, only those looked at are numbered.
      if (this.near || (plant.count <= 6 ? !marked || plant.dashed || this.plants.length === 1 : marked)) this.label(String(v), left + size, top - size, marked ? INK : "#5a6472", marked);
    }
  }

  label(text, left, top, colour, strong) {
    const c = this.context;
    c.font = `${strong ? "bold 13" : "11"}px system-ui, sans-serif`;
    c.lineWidth = 3;
    c.strokeStyle = "#ffffffd0";
    c.strokeText(text, left, top);
    c.fillStyle = colour;
    c.fillText(text, left, top);
  }

  ring(x, y, r, dash, width) {
    const [left, top] = this.px(x, y), c = this.context;
    c.beginPath();
    c.setLineDash(dash);
    c.lineWidth = width;
    c.arc(left, top, r * this.scale, 0, 2 * Math.PI);
    c.stroke();
    c.setLineDash([]);
  }

  line(a, b, dash, width) {
    const c = this.context;
    c.beginPath();
    c.setLineDash(dash);
    c.lineWidth = width;
    c.moveTo(...this.px(a.x, a.y));
    c.lineTo(...this.px(b.x, b.y));
    c.stroke();
    c.setLineDash([]);
  }

  // The pair: Ds about each, its evading circles or lines, and the closest the two come along them.
  pair(plant, t, looked, line) {
    const { poses, gammas, approach } = this.pairOf(plant, t, looked), c = this.context;
    const inside = apart(...poses) < this.dSafe;
    for (const pose of poses) {
      const [left, top] = this.px(pose.x, pose.y);
      c.strokeStyle = inside ? ALARM : "#555";
      this.ring(pose.x, pose.y, this.dSafe, inside ? [] : [3, 3], inside ? 2.2 : 1.1);
      if (inside) {
        c.fillStyle = ALARM + "22";
        c.fill();
      }
      if (this.near && pose === poses[0] && !line) this.label("Ds", left - 8, top - this.dSafe * this.scale - 4, INK, false);
    }
    c.strokeStyle = inside ? ALARM : INK;
    this.line(...poses, [2, 3], 1.2);
    if (approach) {
      c.strokeStyle = plant.color;
      gammas.forEach((gamma, k) => {
        const round = circle(poses[k], gamma);
        if (round) this.ring(round.x, round.y, round.r, plant.dashed ? [10, 4] : [], 0.9);
        else this.line(poses[k], along(poses[k], gamma, approach.tau * 1.3 + 1), plant.dashed ? [10, 4] : [], 0.9);
      });
      c.strokeStyle = approach.distance < this.dSafe ? ALARM : INK;
      this.line(approach.a, approach.b, [], 3);
      for (const p of [approach.a, approach.b]) this.ring(p.x, p.y, 3 / this.scale, [], 1.5);
      if (!this.near) {
        const [left, top] = this.px((approach.a.x + approach.b.x) / 2, (approach.a.y + approach.b.y) / 2);
        this.label(`${approach.distance.toFixed(2)} m`, left + 26, top + (plant.dashed ? 20 : -10), plant.color, true);
      }
    }
    const gap = `${plant.name}: ${apart(...poses).toFixed(2)} m apart` + (inside ? ", inside Ds" : "");
    if (this.near) this.label(gap, 8, 18 + 17 * line, inside ? ALARM : plant.color, true);
  }
}
