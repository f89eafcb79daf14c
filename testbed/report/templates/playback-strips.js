// Time series under the plan view, drawn by uPlot; a click or drag in one moves the time.
class Strips {
  constructor(root, player) {
    Object.assign(this, { root, player, plots: [] });
    this.refill();
    let width = root.clientWidth;
    new ResizeObserver(() => {
      if (Math.abs(root.clientWidth - width) < 2) return;
      width = root.clientWidth;
      this.refill();
      this.cursor(player.t);
    }).observe(root);
  }

  refill() {
    for (const plot of this.plots) plot.destroy();
    this.root.replaceChildren();
    this.plots = [];
    const player = this.player, shown = player.plants.filter((p) => p.shown);
    if (!shown.length) return;
    // Strips of one vehicle are of the pair's first at the worst moment, or of the pair chosen.
    const lead = shown[0], chosen = player.pair(lead, player.t) || [1];
    const vehicle = chosen[0], box = player.limits;
    this.add("height of every vehicle [m]", shown.flatMap((plant) => plant.tracks.z.map((z, v) => ({
      plant, y: z, width: chosen.includes(v + 1) ? 1.8 : 0.6,
    }))), []);
    if (lead.pairs) this.add("least h of any pair [" + player.unit + "], 0 and above is safe", shown.map((plant) => ({ plant, y: plant.leastH })), [0], true);
    const inputs = [
      ["v", "ground speed", "m/s", [box.v_min_mps, box.v_max_mps]],
      ["omega", "turn rate", "deg/s", [-box.omega_max_degps, box.omega_max_degps]],
      ["zeta", "climb rate", "m/s", [-box.zeta_max_mps, box.zeta_max_mps]],
    ];
    for (const [name, text, unit, limits] of inputs)
      this.add(`vehicle ${vehicle}: ${text} [${unit}], thin: commanded`, shown.flatMap((plant) => [
        { plant, y: plant.tracks[name + "_command"][vehicle - 1], width: 0.8, held: true },
        { plant, y: plant.tracks[name][vehicle - 1], width: 1.8 },
      ]), limits);
  }

  add(title, lines, limits, near) {
    const holder = document.createElement("div"), heading = document.createElement("p");
    heading.textContent = title;
    holder.className = "strip";
    holder.append(heading);
    this.root.append(holder);
    const tables = lines.map((line) => [line.plant.t, line.y]);
    const stepped = uPlot.paths.stepped({ align: 1 });
    const series = lines.map((line) => ({
      stroke: line.plant.color,
      width: line.width || 1.8,
      dash: line.plant.dashed && !line.held ? [6, 4] : [],
      points: { show: false },
      paths: line.held ? stepped : undefined,
      spanGaps: true,
    }));
    const axis = { font: "11px system-ui, sans-serif", size: 44, space: 24, grid: { stroke: "#e4e8ec", width: 1 }, ticks: { show: false }, stroke: "#333" };
    const plot = new uPlot(
      {
        width: Math.max(200, holder.clientWidth),
        height: 130,
        legend: { show: false },
        scales: { x: { time: false, range: [0, this.player.end || 1] }, y: { range: (u, low, high) => this.range(low, high, limits, near) } },
        axes: [{ ...axis, size: 24, space: 50 }, axis],
        series: [{}, ...series],
        cursor: { y: false, points: { show: false }, drag: { x: false, y: false }, bind: this.mute() },
        hooks: { ready: [() => this.cursor(this.player.t)], draw: [(u) => this.limits(u, limits)] },
      },
      tables.length > 1 ? uPlot.join(tables) : tables[0],
      holder,
    );
    const seek = (e) => this.player.seek(plot.posToVal(e.clientX - plot.over.getBoundingClientRect().left, "x"));
    plot.over.addEventListener("pointerdown", (e) => {
      plot.over.setPointerCapture(e.pointerId);
      this.player.play(false);
      seek(e);
    });
    plot.over.addEventListener("pointermove", (e) => e.buttons && seek(e));
    this.plots.push(plot);
  }

  // The cursor is the time shown, not the mouse.
  mute() {
    const nothing = () => () => null;
    return { mousemove: nothing, mouseleave: nothing, mouseenter: nothing, mousedown: nothing, mouseup: nothing, click: nothing, dblclick: nothing };
  }

  range(low, high, limits, near) {
    let [least, most] = [Math.min(low ?? 0, ...limits), Math.max(high ?? 0, ...limits)];
    if (near) most = Math.min(most, Math.max(4 * this.player.dSafe, 2 * Math.abs(least))); // where h decides
    const pad = Math.max(0.08 * (most - least), (1 - most + least) / 2); // a metre or so at least, not noise
    return [least - pad, most + pad];
  }

  limits(plot, limits) {
    const c = plot.ctx;
    c.save();
    c.strokeStyle = "#555";
    c.lineWidth = devicePixelRatio || 1;
    c.setLineDash([2 * c.lineWidth, 3 * c.lineWidth]);
    for (const value of limits) {
      const top = plot.valToPos(value, "y", true);
      c.beginPath();
      c.moveTo(plot.bbox.left, top);
      c.lineTo(plot.bbox.left + plot.bbox.width, top);
      c.stroke();
    }
    c.restore();
  }

  cursor(t) {
    for (const plot of this.plots) if (plot.status) plot.setCursor({ left: plot.valToPos(t, "x"), top: 0 }, false);
  }
}
