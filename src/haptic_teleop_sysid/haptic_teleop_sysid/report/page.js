"use strict";
// What a page does by itself: plots come alive when they are about to be seen; folded parts open for links
// and for print.  Without this script, and on paper, still pictures stand in their places.
(() => {
  const packed = document.getElementById("bokeh");
  let loaded = null;

  async function unpacked() {
    const bytes = Uint8Array.from(atob(packed.textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  }

  // A tag reads "property=--variable"; with "==" the property takes a value for all samples of a line.
  function paint(plots) {
    const style = getComputedStyle(document.documentElement);
    for (const plot of plots) {
      for (const model of plot.references()) {
        for (const tag of model.tags || []) {
          const [, property, sign, name] = /^(\w+)(==?)(--.*)$/.exec(tag) || [];
          const colour = property && style.getPropertyValue(name).trim();
          if (colour) model[property] = sign === "==" ? { value: colour } : colour;
        }
      }
    }
  }

  class Live {
    constructor(figure) {
      this.figure = figure;
      this.content = JSON.parse(figure.querySelector("script").textContent);
      this.plots = {};
      this.view = "response";
      this.finger = matchMedia("(pointer: coarse)").matches;
      figure.addEventListener("click", (e) => this.act(e.target.closest("button")));
      figure.addEventListener("change", () => this.lines());
    }

    async show() {
      for (const part of this.figure.querySelectorAll("[data-view]")) {
        part.hidden = part.dataset.view !== this.view;
      }
      if (this.plots[this.view]) return;
      const { document: content, roots } = this.content[this.view];
      const ids = Object.keys(roots);
      const items = [{ docid: "d", roots, root_ids: ids }];
      await Bokeh.embed.embed_items({ d: content }, items);
      const found = Bokeh.documents.flatMap((each) => each.roots()).filter((plot) => plot.id in roots);
      for (const plot of found) {
        for (const range of [plot.x_range, plot.y_range]) whole.set(range, { start: range.start, end: range.end });
      }
      this.plots[this.view] = found;
      // Bokeh's own stops for the Tab key do nothing here, and do not show: the buttons above are the way.
      for (const id of Object.values(roots)) untabbed(document.getElementById(id));
      paint(found);
      this.lines();
      this.drag();
      for (const plot of found) {
        const readout = document.getElementById(roots[plot.id]).closest(".panel").querySelector(".readout");
        plot.on_event("mousemove", (event) => { readout.textContent = told(plot, event.x, this.content[this.view]); });
        plot.on_event("mouseleave", () => { readout.textContent = ""; });
      }
    }

    lines() {
      const shown = {};
      for (const box of this.figure.querySelectorAll("[data-line]")) shown[box.dataset.line] = box.checked;
      for (const plot of this.plots[this.view] || []) {
        for (const line of plot.renderers) if (line.name in shown) line.visible = shown[line.name];
      }
    }

    // Zooms into a box, or moves. A finger scrolls the page until it is told to move; the buttons zoom.
    drag() {
      const moves = this.figure.querySelector("[data-do=drag]").getAttribute("aria-pressed") === "true";
      for (const plot of this.plots[this.view] || []) {
        const wanted = moves ? "PanTool" : this.finger ? null : "BoxZoomTool";
        plot.toolbar.active_drag = plot.toolbar.tools.find((tool) => tool.type === wanted) || null;
      }
    }

    act(button) {
      if (!button) return;
      const what = button.dataset.do;
      const plots = this.plots[this.view] || [];
      const pressed = button.getAttribute("aria-pressed") !== "true";
      if (button.hasAttribute("aria-pressed")) button.setAttribute("aria-pressed", String(pressed));
      if (what === "view") {
        this.view = pressed ? "difference" : "response";
        this.show().then(() => { this.lines(); this.drag(); });
        return;
      }
      if (what === "drag") {
        this.drag();
        return;
      }
      for (const range of new Set(plots.map((plot) => plot.x_range))) move(range, what);
      if (what === "reset") for (const plot of plots) reset(plot.y_range);
    }
  }

  // The values of all lines shown, at the samples next to x, and where that is: the sample's name, its date.
  function told(plot, x, { names, dated }) {
    const values = new Map();
    let name = "";
    for (const line of plot.renderers) {
      const drawn = line.data_source.get_column("y");
      if (!line.visible || !drawn || values.has(line.name)) continue;
      const times = line.data_source.get_column("x");
      let low = 0;
      let high = times.length - 1;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (times[middle] > x) high = middle;
        else low = middle;
      }
      const nearest = x - times[low] < times[high] - x ? low : high;
      if (names.length === times.length) name = names[nearest];
      if (Number.isFinite(drawn[nearest])) values.set(line.name, drawn[nearest]);
    }
    const parts = [...values].map(([label, value]) => `${label} ${Number(value.toPrecision(5))}`);
    const when = dated ? new Date(x).toISOString().slice(0, 16).replace("T", " ") : Number(x.toPrecision(5));
    return `at ${name || when}: ${parts.join(", ")}`;
  }

  function untabbed(part) {
    for (const each of part.querySelectorAll("*")) {
      if (each.tabIndex >= 0) each.tabIndex = -1;
      if (each.shadowRoot) untabbed(each.shadowRoot);
    }
  }

  const whole = new Map();

  function reset(range) {
    range.setv(whole.get(range));
  }

  function move(range, what) {
    const { start, end } = range;
    const middle = (start + end) / 2;
    const step = { left: -0.25, right: 0.25 }[what] || 0;
    const half = ((end - start) / 2) * ({ in: 0.5, out: 2 }[what] || 1);
    const centre = middle + step * (end - start);
    if (what === "reset") reset(range);
    else range.setv({ start: centre - half, end: centre + half });
  }

  const lives = new Map();

  async function wake(figure) {
    if (lives.has(figure)) return;
    const one = new Live(figure);
    lives.set(figure, one);
    try {
      loaded = loaded || unpacked();
      await loaded;
      figure.classList.add("awake");
      await one.show();
      figure.dataset.ready = "yes";
    } catch (error) {
      // The still picture remains.
      figure.classList.remove("awake");
      console.error(error);
    }
  }

  const plots = document.querySelectorAll("figure.plot");
  if (packed && "DecompressionStream" in window) {
    const seen = new IntersectionObserver((entries) => {
      for (const entry of entries) if (entry.isIntersecting) wake(entry.target);
    }, { rootMargin: "600px" });
    plots.forEach((figure) => seen.observe(figure));
  }
  const dark = matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", () => {
    for (const one of lives.values()) for (const found of Object.values(one.plots)) paint(found);
  });

  // A table or picture that goes on beyond its box says so: a column out of sight is one that nobody looks for.
  const boxes = new ResizeObserver((entries) => {
    for (const { target } of entries) {
      target.previousElementSibling.hidden = target.scrollWidth <= target.clientWidth + 1;
    }
  });
  document.querySelectorAll(".scroll, .fixed > .still").forEach((box) => boxes.observe(box));

  function unfold() {
    const target = location.hash.length > 1 && document.getElementById(location.hash.slice(1));
    const folded = target && target.querySelector(":scope > details");
    if (folded) {
      folded.open = true;
      target.scrollIntoView();
    }
  }
  addEventListener("hashchange", unfold);
  unfold();

  // Paper shows everything.
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    for (const one of opened) one.open = true;
  });
  addEventListener("afterprint", () => {
    for (const one of opened) one.open = false;
  });
})();
