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

  // Whoever holds the button for longer than Bokeh's 300 ms before moving wants to zoom all the same: nothing
  // here answers to a long press, after which Bokeh sees no drag any more.
  function patient(plot) {
    const gestures = Bokeh.index.get(plot)?.canvas_view.ui_event_bus.ui_gestures;
    if (gestures) gestures.constructor.press_threshold = 2 ** 31 - 1;
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
      const { view } = this;
      for (const part of this.figure.querySelectorAll("[data-view]")) {
        part.hidden = part.dataset.view !== view;
      }
      if (this.plots[view]) return;
      const { document: content, roots, axes } = this.content[view];
      const ids = Object.keys(roots);
      const items = [{ docid: "d", roots, root_ids: ids }];
      await Bokeh.embed.embed_items({ d: content }, items);
      const found = Bokeh.documents.flatMap((each) => each.roots()).filter((plot) => plot.id in roots);
      for (const plot of found) {
        for (const range of [plot.x_range, plot.y_range]) whole.set(range, { start: range.start, end: range.end });
      }
      this.plots[view] = found;
      await Samples.fill(found, this.content[view].samples);
      // Bokeh's own stops for the Tab key do nothing here, and do not show: the canvas around them is one.
      for (const id of Object.values(roots)) untabbed(document.getElementById(id));
      for (const plot of found) patient(plot);
      paint(found);
      this.lines();
      this.drag();
      const panels = found.map((plot) => {
        const stop = document.getElementById(roots[plot.id]);
        return { plot, stop, readout: stop.closest(".panel").querySelector(".readout"), axes: axes[plot.id] };
      });
      const order = [...this.figure.querySelectorAll("[data-line]")].map((box) => box.dataset.line);
      const said = this.figure.querySelector(".said");
      new Cursor(panels, this.content[view], order, said, (what, about) => this.zoom(what, about));
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
      this.zoom(what, () => undefined);
    }

    // All panels closer, wider, aside or whole; about(range): around which x, else around the middle.
    zoom(what, about) {
      const plots = this.plots[this.view] || [];
      for (const range of new Set(plots.map((plot) => plot.x_range))) move(range, what, about(range));
      if (what === "reset") for (const plot of plots) reset(plot.y_range);
    }
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

  function move(range, what, x) {
    const { start, end } = range;
    const middle = (start + end) / 2;
    const step = { left: -0.25, right: 0.25 }[what] || 0;
    const factor = { in: 0.5, out: 2 }[what] || 1;
    const half = ((end - start) / 2) * factor;
    const fixed = x ?? middle;
    const centre = fixed + factor * (middle - fixed) + step * (end - start);
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
