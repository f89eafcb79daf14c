// The player: time, speed, what is looked at; the strips below the plan view and the numbers beside it.

class Player {
  constructor(root) {
    const raw = JSON.parse(document.getElementById(root.dataset.source).textContent);
    this.root = root;
    this.limits = raw.limits;
    this.dSafe = raw.d_safe;
    this.unit = raw.unit;
    this.plants = raw.plants.map((plant) => new Plant(plant, raw.steps));
    this.end = Math.max(...this.plants.map((plant) => plant.end));
    this.at = (name) => root.querySelector(`[data-part="${name}"]`);
    this.view = new PlanView(this.at("plan"), this.plants, this.dSafe, this.plants[0].count <= 3 ? "circles" : "all", raw.fences);
    this.close = new PlanView(this.at("close"), this.plants, this.dSafe, "close", raw.fences);
    this.playing = false;
    this.drawn = 0;
    this.connect();
    this.fillPairs();
    this.strips = new Strips(this.at("strips"), this);
    const lost = this.plants.find((p) => p.moments.some((m) => m.lost)) || this.plants[0];
    this.root.dataset.playing = false;
    this.seek(lost.moments.length ? lost.moments[0].t : 0);
  }

  connect() {
    const slider = this.at("time");
    slider.max = this.end;
    slider.step = Math.max(0.001, Math.min(0.01, this.end / 2000));
    slider.addEventListener("input", () => this.seek(Number(slider.value)));
    this.at("play").addEventListener("click", () => this.play(!this.playing));
    this.at("start").addEventListener("click", () => this.seek(0));
    this.at("back").addEventListener("click", () => this.step(-1));
    this.at("forward").addEventListener("click", () => this.step(1));
    this.at("view").value = this.view.mode;
    this.at("view").addEventListener("change", (e) => {
      this.view.mode = e.target.value;
      this.show();
    });
    this.at("pair").addEventListener("change", () => {
      this.strips.refill();
      this.show();
    });
    this.at("save").addEventListener("click", () => this.save());
    for (const box of this.root.querySelectorAll("[data-plant]"))
      box.addEventListener("change", () => {
        this.plants[Number(box.dataset.plant)].shown = box.checked;
        this.strips.refill();
        this.show();
      });
    for (const button of document.querySelectorAll(`[data-seek-in="${this.root.id}"]`))
      button.addEventListener("click", () => {
        this.play(false);
        this.choose(button.dataset.vehicles);
        this.seek(Number(button.dataset.seek));
        this.root.scrollIntoView({ block: "nearest" });
      });
    const plan = this.at("plan");
    plan.addEventListener("keydown", (e) => this.key(e));
    plan.addEventListener("wheel", (e) => this.zoom(e), { passive: false });
    let held = null;
    plan.addEventListener("pointerdown", (e) => {
      held = [e.clientX, e.clientY];
      plan.setPointerCapture(e.pointerId);
    });
    plan.addEventListener("pointermove", (e) => {
      if (!held) return;
      this.pan(e.clientX - held[0], e.clientY - held[1]);
      held = [e.clientX, e.clientY];
    });
    plan.addEventListener("pointerup", () => (held = null));
  }

  key(event) {
    const acts = {
      " ": () => this.play(!this.playing),
      ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1),
      Home: () => this.seek(0), End: () => this.seek(this.end),
      "+": () => this.scale(1.25), "-": () => this.scale(0.8),
    };
    if (!acts[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    acts[event.key]();
  }

  zoom(event) {
    if (!event.ctrlKey && document.activeElement !== this.at("plan")) return; // a page scrolls, unless asked
    event.preventDefault();
    this.scale(event.deltaY < 0 ? 1.15 : 1 / 1.15);
  }

  scale(factor) {
    this.free();
    this.view.scale *= factor;
    this.show();
  }

  pan(dx, dy) {
    this.free();
    this.view.centre[0] -= dx / this.view.scale;
    this.view.centre[1] += dy / this.view.scale;
    this.show();
  }

  free() {
    this.view.mode = this.at("view").value = "free";
  }

  fillPairs() {
    const select = this.at("pair"), n = this.plants[0].count;
    const add = (value, text) => select.add(new Option(text, value));
    if (n < 2) return add("none", "none");
    add("lowest", "least h at each moment");
    add("closest", "closest at each moment");
    const worst = new Map();
    for (const plant of this.plants)
      for (const moment of plant.moments)
        if (moment.vehicles.length === 2) {
          const key = moment.vehicles.join("-");
          worst.set(key, [...(worst.get(key) || []), `${plant.name}: ${moment.label}`]);
        }
    for (const [key, why] of worst) add(key, `${key.replace("-", " and ")} (${why.join("; ")})`);
    if (n <= 30)
      for (let i = 1; i <= n; i++)
        for (let j = i + 1; j <= n; j++) if (!worst.has(`${i}-${j}`)) add(`${i}-${j}`, `${i} and ${j}`);
  }

  choose(vehicles) {
    const select = this.at("pair");
    if ([...select.options].some((option) => option.value === vehicles)) {
      select.value = vehicles;
      this.strips.refill();
    }
  }

  // The vehicles looked at on a plant at a time.
  pair(plant, t) {
    const chosen = this.at("pair").value;
    if (chosen === "none" || !plant.pairs) return null;
    if (chosen === "lowest" || chosen === "closest") return plant.pairs.vehicles[plant.pairs[chosen][plant.frame(t)]];
    return chosen.split("-").map(Number);
  }

  step(direction) {
    this.play(false);
    const frames = this.plants[0].t, dt = this.end / Math.max(1, frames.length - 1);
    this.seek(this.t + direction * Math.max(dt, 0.01));
  }

  play(on) {
    if (on === this.playing) return;
    this.playing = on;
    this.root.dataset.playing = on;
    if (on && this.t >= this.end) this.t = 0;
    this.at("play").textContent = on ? "❚❚ Pause" : "▶ Play";
    this.at("play").setAttribute("aria-pressed", String(on));
    this.at("readout").setAttribute("aria-live", on ? "off" : "polite");
    let before = performance.now();
    const tick = (now) => {
      if (!this.playing) return;
      const t = this.t + ((now - before) / 1000) * Number(this.at("rate").value);
      before = now;
      this.seek(Math.min(t, this.end));
      if (t >= this.end) this.play(false);
      else requestAnimationFrame(tick);
    };
    if (on) requestAnimationFrame(tick);
    else this.tell(true);
  }

  seek(t) {
    this.t = Math.min(this.end, Math.max(0, t));
    this.show();
  }

  show() {
    const slider = this.at("time");
    if (Math.abs(Number(slider.value) - this.t) > Number(slider.step) / 2) slider.value = this.t;
    slider.setAttribute("aria-valuetext", `${this.t.toFixed(2)} seconds`);
    this.at("clock").textContent = `${this.t.toFixed(2)} of ${this.end.toFixed(0)} s`;
    const pair = this.at("pair").value === "none" ? null : (plant, t) => this.pair(plant, t);
    this.view.draw(this.t, pair);
    this.close.draw(this.t, pair);
    this.strips.cursor(this.t);
    this.tell(!this.playing);
    this.drawn += 1;
    Object.assign(this.root.dataset, { t: this.t.toFixed(4), drawn: this.drawn });
  }

  // Numbers at the cursor; while playing, ten times a second.
  tell(now) {
    const time = performance.now();
    if (!now && time - (this.told || 0) < 100) return;
    this.told = time;
    const said = [], rows = [];
    for (const plant of this.plants.filter((p) => p.shown)) {
      const pair = this.pair(plant, this.t);
      if (pair) said.push(this.sentence(plant, pair));
      else said.push(`${plant.name}: one vehicle, no pair.`);
      for (const vehicle of pair || [1]) rows.push(this.row(plant, vehicle));
    }
    this.at("readout").textContent = said.join(" ");
    this.at("inputs").replaceChildren(...rows);
  }

  sentence(plant, [i, j]) {
    const a = plant.pose(i, this.t), b = plant.pose(j, this.t), distance = apart(a, b);
    const inside = distance < this.dSafe, h = plant.recorded(i, j, this.t);
    const parts = [`${plant.name}${this.t > plant.end ? " (ended)" : ""}: vehicles ${i} and ${j} ${distance.toFixed(2)} m apart`];
    parts.push(`${Math.abs(distance - this.dSafe).toFixed(2)} m ${inside ? "INSIDE" : "outside"} Ds`);
    if (h !== null) parts.push(`h ${h.toFixed(2)} ${this.unit}`);
    if (Math.abs(a.z - b.z) > 0.005) parts.push(`${Math.abs(a.z - b.z).toFixed(2)} m of it in height`);
    return parts.join(", ") + ".";
  }

  row(plant, vehicle) {
    const inputs = plant.inputs(vehicle, this.t), row = document.createElement("tr");
    const cell = (text) => row.append(Object.assign(document.createElement("td"), { textContent: text }));
    cell(`${plant.name} ${vehicle}`);
    for (const name of ["v", "omega", "zeta"]) cell(`${inputs[name + "_command"].toFixed(2)} → ${inputs[name].toFixed(2)}`);
    cell(inputs.override ? "acts" : "–");
    return row;
  }

  // The tracks the page holds, as CSV.
  save() {
    const names = ["x", "y", "z", "theta", "v", "v_command", "omega", "omega_command", "zeta", "zeta_command"];
    const units = ["m", "m", "m", "rad", "mps", "mps", "degps", "degps", "mps", "mps"];
    const lines = [["plant", "t_s", "vehicle", ...names.map((name, k) => `${name}_${units[k]}`)].join()];
    for (const plant of this.plants)
      for (let k = 0; k < plant.t.length; k++)
        for (let v = 0; v < plant.count; v++) {
          const values = names.map((name) => plant.tracks[name][v][k].toFixed(4));
          lines.push([JSON.stringify(plant.name), plant.t[k].toFixed(4), v + 1, ...values].join());
        }
    const link = Object.assign(document.createElement("a"), { download: "tracks.csv" });
    link.href = URL.createObjectURL(new Blob([lines.join("\n") + "\n"], { type: "text/csv" }));
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }
}

for (const root of document.querySelectorAll(".player")) root.player = new Player(root);
// Everything prints: folded parts are opened for it.
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => (part.open = true)));
