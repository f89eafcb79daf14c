// Tracks out of their coded form, values at any time, and where the evading manoeuvres lead.

const TURNING = 1e-9; // rad/s, below it a manoeuvre is straight

function decode(deltas, step) {
  const values = new Float64Array(deltas.length);
  let sum = 0;
  for (let k = 0; k < deltas.length; k++) {
    sum += deltas[k];
    values[k] = sum * step;
  }
  return values;
}

class Plant {
  constructor(raw, steps) {
    Object.assign(this, { name: raw.name, color: raw.color, dashed: raw.dashed, gamma: raw.gamma });
    Object.assign(this, { critical: raw.critical, moments: raw.moments, ended: raw.ended, left: raw.left, shown: true });
    this.t = decode(raw.t, steps.t);
    this.end = this.t[this.t.length - 1];
    this.tracks = {};
    for (const [name, tracks] of Object.entries(raw.tracks))
      this.tracks[name] = tracks.map((track) => decode(track, steps[name]));
    this.count = this.tracks.x.length;
    this.pairs = raw.pairs;
    if (raw.pairs) {
      this.leastH = decode(raw.pairs.least_h, steps.h);
      this.h = Object.fromEntries(Object.entries(raw.pairs.h).map(([pair, h]) => [pair, decode(h, steps.h)]));
    }
  }

  // The last frame at or before t.
  frame(t) {
    let low = 0, high = this.t.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.t[middle] <= t) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // A series between its frames, straight from one to the next.
  between(series, t) {
    const k = this.frame(t), next = Math.min(k + 1, this.t.length - 1);
    const span = this.t[next] - this.t[k];
    const share = span > 0 ? Math.min(1, Math.max(0, (t - this.t[k]) / span)) : 0;
    return series[k] + share * (series[next] - series[k]);
  }

  pose(vehicle, t) {
    const at = (name) => this.between(this.tracks[name][vehicle - 1], t);
    return { x: at("x"), y: at("y"), z: at("z"), theta: at("theta") };
  }

  // What is commanded from a frame on, and what was flown by the next.
  inputs(vehicle, t) {
    const k = this.frame(t), next = Math.min(k + 1, this.t.length - 1);
    const inputs = { override: this.tracks.override[vehicle - 1][k] > 0.5 };
    for (const name of ["v", "omega", "zeta"]) {
      inputs[name] = this.tracks[name][vehicle - 1][next];
      inputs[name + "_command"] = this.tracks[name + "_command"][vehicle - 1][k];
    }
    return inputs;
  }

  manoeuvre(i, j) {
    if (this.gamma.kind === "none") return null;
    if (this.gamma.kind === "pairs") {
      const own = this.gamma.pairs[`${i}-${j}`];
      return own ? [own, own] : null;
    }
    return [this.gamma.vehicles[i - 1], this.gamma.vehicles[j - 1]];
  }

  // The barrier as recorded, where this pair's is among what the page holds.
  recorded(i, j, t) {
    if (!this.pairs) return null;
    const own = this.h[`${i}-${j}`];
    if (own) return this.between(own, t);
    const k = this.frame(t), lowest = this.pairs.vehicles[this.pairs.lowest[k]];
    return lowest[0] === i && lowest[1] === j ? this.leastH[k] : null;
  }
}

function apart(a, b) {
  return Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z);
}

// Where a vehicle is tau seconds after it begins its manoeuvre (v, omega, zeta).
function along(pose, [v, omega, zeta], tau) {
  const z = pose.z + zeta * tau;
  if (Math.abs(omega) < TURNING)
    return { x: pose.x + v * tau * Math.cos(pose.theta), y: pose.y + v * tau * Math.sin(pose.theta), z };
  const r = v / omega, turned = pose.theta + omega * tau;
  return {
    x: pose.x + r * (Math.sin(turned) - Math.sin(pose.theta)),
    y: pose.y - r * (Math.cos(turned) - Math.cos(pose.theta)),
    z,
  };
}

function circle(pose, [v, omega]) {
  if (Math.abs(omega) < TURNING) return null;
  const r = v / omega;
  return { x: pose.x - r * Math.sin(pose.theta), y: pose.y + r * Math.cos(pose.theta), r: Math.abs(r) };
}

// How long a search must look: once round, as often as unequal turns need to meet; straight flyers until past.
function horizon(a, b, [gammaA, gammaB]) {
  const rates = [gammaA[1], gammaB[1]].map(Math.abs).filter((rate) => rate > TURNING);
  if (rates.length === 2 && Math.abs(gammaA[1] - gammaB[1]) < TURNING) return (2 * Math.PI) / rates[0];
  if (rates.length) return (16 * Math.PI) / Math.min(...rates);
  const wx = gammaA[0] * Math.cos(a.theta) - gammaB[0] * Math.cos(b.theta);
  const wy = gammaA[0] * Math.sin(a.theta) - gammaB[0] * Math.sin(b.theta);
  const wz = gammaA[2] - gammaB[2];
  const closing = (a.x - b.x) * wx + (a.y - b.y) * wy + (a.z - b.z) * wz;
  return Math.max(0, -closing / (wx * wx + wy * wy + wz * wz || 1)) * 1.0001 + 1e-3;
}

// The closest two vehicles come if from now on both fly gamma: the distance h is about.
function closestApproach(a, b, gammas) {
  const end = horizon(a, b, gammas), samples = 720;
  const gap = (tau) => apart(along(a, gammas[0], tau), along(b, gammas[1], tau));
  let best = 0, least = Infinity;
  for (let k = 0; k <= samples; k++) {
    const here = gap((k * end) / samples);
    if (here < least) [best, least] = [k, here];
  }
  let low = (Math.max(0, best - 1) * end) / samples, high = (Math.min(samples, best + 1) * end) / samples;
  for (let k = 0; k < 30; k++) {
    const left = low + 0.382 * (high - low), right = low + 0.618 * (high - low);
    if (gap(left) < gap(right)) high = right;
    else low = left;
  }
  const tau = (low + high) / 2;
  return { tau, distance: gap(tau), a: along(a, gammas[0], tau), b: along(b, gammas[1], tau) };
}
