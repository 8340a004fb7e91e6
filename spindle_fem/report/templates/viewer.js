/* Orbit view of a surface coloured by temperature. No library, no network. */
(function () {
  "use strict";
  const host = document.getElementById("view3d");
  if (!host) return;
  const data = JSON.parse(document.getElementById("view3d-data").textContent);
  const canvas = host.querySelector("canvas");
  const note = host.querySelector(".view3d-note");
  const readout = host.querySelector(".view3d-readout");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  function giveUp(text) { note.textContent = text; host.classList.add("no-webgl"); }
  if (!gl) { giveUp("This browser offers no WebGL 2, so the interactive view is off. The pictures below show the same field."); return; }
  if (typeof DecompressionStream === "undefined") { giveUp("This browser cannot unpack the interactive view. The pictures below show the same field."); return; }
  function bytes(text) { return Uint8Array.from(atob(text), function (c) { return c.charCodeAt(0); }); }
  async function inflate(packed) {
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }
  const VERTEX = `#version 300 es
    in vec3 place; in vec3 normal; in float value;
    uniform mat3 turn; uniform vec3 centre; uniform vec3 zoom; uniform vec2 shift;
    out vec3 world; out vec3 facing; out float shade;
    void main() {
      world = place; facing = turn * normal; shade = value;
      vec3 seen = turn * (place - centre);
      gl_Position = vec4(seen.xy * zoom.xy + shift, -seen.z * zoom.z, 1.0);
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    in vec3 world; in vec3 facing; in float shade;
    uniform sampler2D colours; uniform bool open; uniform bool cap; uniform bool pick; uniform float part;
    uniform vec3 plain; uniform bool byPart;
    out vec4 ink;
    void main() {
      if (open && !cap && world.x < 0.0) discard;
      if (pick) { float t = floor(shade * 65535.0 + 0.5); ink = vec4(floor(t / 256.0) / 255.0, mod(t, 256.0) / 255.0, part / 255.0, 1.0); return; }
      vec3 n = normalize(facing); if (n.z < 0.0) n = -n;
      float light = cap ? 1.0 : 0.46 + 0.42 * max(dot(n, normalize(vec3(-0.35, 0.55, 0.8))), 0.0) + 0.2 * max(dot(n, normalize(vec3(0.6, -0.5, 0.5))), 0.0);
      vec3 base = byPart ? plain : texture(colours, vec2(shade * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb;
      ink = vec4(base * min(light, 1.06), 1.0);
    }`;
  function shader(kind, text) {
    const s = gl.createShader(kind); gl.shaderSource(s, text); gl.compileShader(s);
    if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
    return s;
  }
  let program;
  try {
    program = gl.createProgram();
    gl.attachShader(program, shader(gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(program, shader(gl.FRAGMENT_SHADER, FRAGMENT));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  } catch (error) { giveUp("The interactive view did not start (" + error.message + "). The pictures below show the same field."); return; }
  gl.useProgram(program);
  const at = {}; ["turn", "centre", "zoom", "shift", "colours", "open", "cap", "pick", "part", "plain", "byPart"].forEach(function (n) { at[n] = gl.getUniformLocation(program, n); });
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const lut = bytes(data.colours);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, lut);
  for (const [k, v] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, k, v);

  function buffers(place, normal, value, index) {
    const array = gl.createVertexArray(); gl.bindVertexArray(array);
    for (const [name, content, size] of [["place", place, 3], ["normal", normal, 3], ["value", value, 1]]) {
      const where = gl.getAttribLocation(program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, content, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(where); gl.vertexAttribPointer(where, size, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return array;
  }
  function unpack(raw) {
    const n = data.vertices, m = data.triangles;
    const p = new Uint16Array(raw, 0, 3 * n), q = new Int8Array(raw, 6 * n, 3 * n);
    const t = new Uint16Array(raw.slice(9 * n, 11 * n)), d = new Int32Array(raw.slice(11 * n));
    const place = new Float32Array(3 * n), normal = new Float32Array(3 * n), value = new Float32Array(n), index = new Uint32Array(3 * m);
    for (let i = 0; i < n; i++) {
      for (let k = 0; k < 3; k++) { place[3 * i + k] = data.low[k] + p[k * n + i] / 65535 * data.span; normal[3 * i + k] = q[k * n + i] / 127; }
      value[i] = t[i] / 65535;
    }
    let running = 0;
    for (let i = 0; i < 3 * m; i++) { running += d[i]; index[i] = running; }
    spots = place;
    return buffers(place, normal, value, index);
  }
  function ballBuffers() {
    // A latitude-longitude sphere for each ball; whole balls only on the kept side.
    const rings = 8, sides = 12, place = [], normal = [], value = [], index = [], range = { kept: 0 };
    const balls = data.balls.slice().sort(function (a, b) { return (b[0] > -1e-6) - (a[0] > -1e-6); });
    balls.forEach(function (b) {
      const first = value.length;
      for (let i = 0; i <= rings; i++) for (let j = 0; j < sides; j++) {
        const a = Math.PI * i / rings, c = 2 * Math.PI * j / sides;
        const n = [Math.sin(a) * Math.cos(c), Math.sin(a) * Math.sin(c), Math.cos(a)];
        normal.push(n[0], n[1], n[2]); place.push(b[0] + b[3] * n[0], b[1] + b[3] * n[1], b[2] + b[3] * n[2]);
        value.push((b[4] - data.coldest) / Math.max(data.warmest - data.coldest, 1e-6));
      }
      for (let i = 0; i < rings; i++) for (let j = 0; j < sides; j++) {
        const k = (j + 1) % sides, u = first + i * sides, v = u + sides;
        index.push(u + j, v + j, v + k, u + j, v + k, u + k);
      }
      if (b[0] > -1e-6) range.kept = index.length;
    });
    range.all = index.length;
    range.array = buffers(new Float32Array(place), new Float32Array(normal), new Float32Array(value), new Uint32Array(index));
    return range;
  }
  const state = { yaw: -0.423, pitch: 0.255, zoom: 1, x: 0, y: 0, open: true, hidden: new Set(), balls: true };
  const start = Object.assign({}, state);
  const centre = data.low.map(function (v, k) { return v + data.size[k] / 2; });
  let solid = null, balls = null, asked = false, spots = null;
  function turn() {
    // Viewer at -x with z to the right and y up, then yaw about y and pitch about the screen's x.
    const c = Math.cos(state.yaw), s = Math.sin(state.yaw), d = Math.cos(state.pitch), e = Math.sin(state.pitch);
    const right = [s, 0, c], back = [-c, 0, s];
    const up = [-e * back[0], d, -e * back[2]], out = [d * back[0], e, d * back[2]];
    return [right[0], up[0], out[0], right[1], up[1], out[1], right[2], up[2], out[2]];
  }
  function draw(pick) {
    const w = canvas.width, h = canvas.height;
    gl.viewport(0, 0, w, h);
    gl.clearColor(1, 1, 1, pick ? 0 : 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const reach = Math.hypot(data.size[0], data.size[1], data.size[2]), m = turn();
    // Fitted on load and by the view buttons only, so that turning does not pump the size.
    if (!state.fit) {
      let wide = 1e-9, tall = 1e-9;
      for (let i = 0; i < spots.length; i += 9) {
        const x = spots[i] - centre[0], y = spots[i + 1] - centre[1], z = spots[i + 2] - centre[2];
        wide = Math.max(wide, Math.abs(m[0] * x + m[3] * y + m[6] * z));
        tall = Math.max(tall, Math.abs(m[1] * x + m[4] * y + m[7] * z));
      }
      state.fit = 0.95 * Math.min(w / h / wide, 1 / tall);
    }
    const fit = state.fit * state.zoom;
    gl.uniformMatrix3fv(at.turn, false, m);
    gl.uniform3fv(at.centre, centre);
    gl.uniform3f(at.zoom, fit * h / w, fit, 0.9 / reach);
    gl.uniform2f(at.shift, state.x, state.y);
    gl.uniform1i(at.open, state.open); gl.uniform1i(at.pick, pick); gl.uniform1i(at.byPart, 0);
    gl.bindVertexArray(solid);
    data.parts.forEach(function (p, i) {
      if (state.hidden.has(i)) return;
      gl.uniform1f(at.part, i);
      gl.uniform1i(at.cap, 0);
      gl.drawElements(gl.TRIANGLES, 3 * p.count, gl.UNSIGNED_INT, 12 * p.first);
      if (state.open && p.cap_count) { gl.uniform1i(at.cap, 1); gl.drawElements(gl.TRIANGLES, 3 * p.cap_count, gl.UNSIGNED_INT, 12 * p.cap_first); }
    });
    if (state.balls && balls.all) {
      gl.bindVertexArray(balls.array);
      gl.uniform1f(at.part, 254); gl.uniform1i(at.cap, 0); gl.uniform1i(at.open, 0);
      gl.drawElements(gl.TRIANGLES, state.open ? balls.kept : balls.all, gl.UNSIGNED_INT, 0);
    }
  }
  function redraw() { if (!asked) { asked = true; requestAnimationFrame(function () { asked = false; resize(); draw(false); }); } }
  function resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), w = Math.round(canvas.clientWidth * ratio), h = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  }
  function readAt(event) {
    const box = canvas.getBoundingClientRect();
    const x = Math.floor((event.clientX - box.left) / box.width * canvas.width), y = Math.floor((box.bottom - event.clientY) / box.height * canvas.height);
    draw(true);
    const pixel = new Uint8Array(4);
    gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    draw(false);
    if (!pixel[3]) { readout.textContent = "Point at the machine to read its temperature."; return; }
    const t = data.coldest + (pixel[0] * 256 + pixel[1]) / 65535 * (data.warmest - data.coldest);
    const name = pixel[2] === 254 ? "balls" : (data.parts[pixel[2]] || { name: "" }).name;
    readout.textContent = name + ": " + t.toFixed(1) + " °C";
  }
  function controls() {
    let drag = null;
    canvas.addEventListener("pointerdown", function (e) { drag = { x: e.clientX, y: e.clientY, pan: e.shiftKey || e.button !== 0 }; canvas.setPointerCapture(e.pointerId); });
    canvas.addEventListener("pointerup", function () { drag = null; });
    canvas.addEventListener("contextmenu", function (e) { e.preventDefault(); });
    canvas.addEventListener("pointermove", function (e) {
      if (!drag) { readAt(e); return; }
      const dx = e.clientX - drag.x, dy = e.clientY - drag.y; drag.x = e.clientX; drag.y = e.clientY;
      if (drag.pan) { state.x += 2 * dx / canvas.clientWidth; state.y -= 2 * dy / canvas.clientHeight; }
      else { state.yaw += 0.008 * dx; state.pitch = Math.max(-1.55, Math.min(1.55, state.pitch + 0.008 * dy)); }
      redraw();
    });
    canvas.addEventListener("wheel", function (e) { if (!e.ctrlKey && document.activeElement !== canvas) return; e.preventDefault(); state.zoom *= Math.exp(-0.0012 * e.deltaY); redraw(); }, { passive: false });
    canvas.addEventListener("keydown", function (e) {
      const step = { ArrowLeft: ["yaw", -0.1], ArrowRight: ["yaw", 0.1], ArrowUp: ["pitch", -0.1], ArrowDown: ["pitch", 0.1] }[e.key];
      if (step) { state[step[0]] += step[1]; } else if (e.key === "+") { state.zoom *= 1.15; } else if (e.key === "-") { state.zoom /= 1.15; } else return;
      e.preventDefault(); redraw();
    });
    const views = { side: [0, 0], nose: [-1.5708, 0], drive: [1.5708, 0], top: [0, 1.5] };
    host.querySelectorAll("[data-view]").forEach(function (b) {
      b.addEventListener("click", function () {
        if (b.dataset.view === "start") { Object.assign(state, { yaw: start.yaw, pitch: start.pitch, zoom: 1, x: 0, y: 0 }); }
        else { state.yaw = views[b.dataset.view][0]; state.pitch = views[b.dataset.view][1]; }
        state.fit = 0; redraw();
      });
    });
    host.querySelectorAll("[data-zoom]").forEach(function (b) { b.addEventListener("click", function () { state.zoom *= parseFloat(b.dataset.zoom); redraw(); }); });
    host.querySelector("[data-open]").addEventListener("change", function (e) { state.open = e.target.checked; redraw(); });
    const list = host.querySelector(".view3d-parts");
    data.parts.concat(data.balls.length ? [{ name: "balls" }] : []).forEach(function (p, i) {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox"; box.checked = true;
      box.addEventListener("change", function () {
        if (i === data.parts.length) state.balls = box.checked; else if (box.checked) state.hidden.delete(i); else state.hidden.add(i);
        redraw();
      });
      label.append(box, document.createTextNode(" " + p.name)); list.append(label);
    });
    window.addEventListener("resize", function () { state.fit = 0; redraw(); });
  }
  function legend() {
    const bar = host.querySelector(".view3d-bar"), stops = [];
    for (let i = 0; i <= 32; i++) { const k = Math.min(255, i * 8); stops.push("rgb(" + lut[3 * k] + "," + lut[3 * k + 1] + "," + lut[3 * k + 2] + ")"); }
    bar.style.background = "linear-gradient(to right," + stops.join(",") + ")";
    const ticks = host.querySelector(".view3d-ticks");
    for (let i = 0; i <= 5; i++) { const s = document.createElement("span"); s.textContent = (data.coldest + (data.warmest - data.coldest) * i / 5).toFixed(1) + (i === 5 ? " °C" : ""); ticks.append(s); }
  }
  inflate(bytes(data.block)).then(function (raw) {
    solid = unpack(raw); balls = ballBuffers(); controls(); legend(); redraw();
  }).catch(function (error) { giveUp("The interactive view could not be unpacked (" + error.message + "). The pictures below show the same field."); });
})();
