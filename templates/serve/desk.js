// The desk's only script: it says what is wrong while somebody types, shows how far a certificate is, and turns the residual field.
// Every page works without it.
"use strict";

function texts(list, items) {
  for (const item of items) list.append(Object.assign(document.createElement("li"), { textContent: item }));
}

function show(place, found) {
  const list = document.createElement("ul");
  const [word, text] = found.problems.length ? ["bad", "✗ This would stop a certificate"]
    : found.warnings.length ? ["open", "! Nothing would stop a certificate; to be known"] : ["good", "✓ Sound"];
  texts(list, found.problems.length ? found.problems : found.warnings);
  place.replaceChildren(Object.assign(document.createElement("p"), { className: word, textContent: text }), list);
}

for (const form of document.querySelectorAll("form[data-check]")) {
  const place = form.querySelector(".says");
  let timer = 0, asked = 0;
  form.addEventListener("input", () => {
    clearTimeout(timer);
    timer = setTimeout(async () => {
      const own = ++asked;
      try {
        const answer = await fetch(form.dataset.check, { method: "POST", body: new URLSearchParams(new FormData(form)) });
        if (answer.ok && own === asked) show(place, await answer.json());
      } catch { /* the server was ended: the next form says so */ }
    }, 500);
  });
}

for (const field of document.querySelectorAll(".drop input[type=file]")) {
  field.addEventListener("change", () => { if (field.files.length) field.form.requestSubmit(); });
}

for (const place of document.querySelectorAll("[data-events]")) {
  const events = new EventSource(place.dataset.events);
  events.onmessage = (event) => {
    const state = JSON.parse(event.data);
    const what = place.querySelector(".what");
    if (what.textContent !== state.what) what.textContent = state.what;
    place.querySelector("progress").value = state.percent;
    place.querySelector(".left").textContent = state.left;
    if (state.over) { events.close(); location.reload(); }
  };
}

const SIZE = { alpha: 0.6, beta: 0.5 };

function turned(point, angles) {
  const [x, y, z] = point, { alpha, beta } = angles;
  const u = x * Math.cos(alpha) - y * Math.sin(alpha), v = x * Math.sin(alpha) + y * Math.cos(alpha);
  return [u, v * Math.sin(beta) - z * Math.cos(beta)];
}

function drawn(canvas, field, angles, after) {
  const pen = canvas.getContext("2d"), css = getComputedStyle(document.documentElement);
  const colour = (name) => css.getPropertyValue(name).trim();
  const low = [0, 1, 2].map((i) => Math.min(...field.place.map((p) => p[i])));
  const high = [0, 1, 2].map((i) => Math.max(...field.place.map((p) => p[i])));
  const span = Math.max(1, ...high.map((h, i) => h - low[i])), middle = high.map((h, i) => (h + low[i]) / 2);
  const longest = Math.max(1e-9, ...field.before.map((v) => Math.hypot(...v)));
  const scale = 0.58 * Math.min(canvas.width, canvas.height) / span, magnified = 0.16 * span / longest;
  const at = (p) => {
    const [u, v] = turned(p.map((one, i) => one - middle[i]), angles);
    return [canvas.width / 2 + scale * u, canvas.height / 2 + scale * v];
  };
  const line = (a, b) => { pen.beginPath(); pen.moveTo(...at(a)); pen.lineTo(...at(b)); pen.stroke(); };
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.strokeStyle = colour("--rule"); pen.lineWidth = 1.5;
  for (const [i, j, k] of [[0, 1, 2], [1, 0, 2], [2, 0, 1]]) for (const a of [low, high]) for (const b of [low, high]) {
    const from = [], to = [];
    from[i] = low[i]; to[i] = high[i]; from[j] = to[j] = a[j]; from[k] = to[k] = b[k];
    line(from, to);
  }
  pen.fillStyle = colour("--muted"); pen.font = "20px sans-serif";
  ["x", "y", "z"].forEach((name, i) => { const end = [...low]; end[i] = high[i]; const [u, v] = at(end); pen.fillText(name, u + 8, v - 8); });
  const vectors = after ? field.after : field.before;
  field.place.forEach((p, n) => {
    const v = vectors[n], beyond = Math.hypot(...v) > field.limit[n];
    pen.strokeStyle = colour(beyond ? "--bad" : "--accent"); pen.lineWidth = beyond ? 3 : 1.5;
    line(p, p.map((one, i) => one + magnified * v[i]));
    pen.fillStyle = pen.strokeStyle; pen.beginPath(); pen.arc(...at(p), 3, 0, 7); pen.fill();
  });
}

for (const figure of document.querySelectorAll("[data-field]")) {
  const canvas = figure.querySelector("canvas"), caption = figure.querySelector("figcaption");
  fetch(figure.dataset.field).then((answer) => answer.json()).then((field) => {
    const angles = { ...SIZE };
    let after = false;
    const draw = () => drawn(canvas, field, angles, after);
    const turn = (du, dv) => { angles.alpha += du; angles.beta = Math.max(-1.57, Math.min(1.57, angles.beta + dv)); draw(); };
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) turn(event.movementX / 120, event.movementY / 120); });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] }[event.key];
      if (step) { event.preventDefault(); turn(...step); }
    });
    const longest = Math.max(...field.before.map((v) => Math.hypot(...v)));
    caption.textContent = `Residuals as vectors where they were measured, the longest ${longest.toPrecision(2)} µm; in red those longer ` +
      "than their U. Turn it by dragging, or with the arrow keys. ";
    if (field.found) {
      const button = Object.assign(document.createElement("button"), { type: "button", className: "second", textContent: "Show after: with what was found" });
      button.addEventListener("click", () => {
        after = !after; draw();
        button.textContent = after ? "Show before: what the model leaves" : "Show after: with what was found";
      });
      caption.append(button);
    }
    draw();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  });
}
