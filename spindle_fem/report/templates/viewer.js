/* Orbit view of a machine coloured by temperature: cut, times, growth, histories. No library, no network. */
(function () {
  "use strict";
  const host = document.getElementById("view3d");
  if (!host) return;
  const data = JSON.parse(document.getElementById("view3d-data").textContent);
  const find = function (what) { return host.querySelector(what); };
  const canvas = find("canvas"), note = find(".view3d-note"), readout = find(".view3d-readout"), names = find(".view3d-names");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  const INSTEAD = document.querySelector("main figure") ? " The pictures below show the same field." : "";
  function giveUp(text) { note.textContent = text + INSTEAD; host.classList.add("no-webgl"); }
  if (!gl) { giveUp("This browser offers no WebGL 2, so the interactive view is off."); return; }
  if (typeof DecompressionStream === "undefined") { giveUp("This browser cannot unpack the interactive view."); return; }
  function bytes(text) { return Uint8Array.from(atob(text), function (c) { return c.charCodeAt(0); }); }
  async function inflate(packed) {
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  // ---------------------------------------------------------------- what the graphics processor runs
  const VERTEX = `#version 300 es
    in vec3 place; in vec3 normal; in vec3 moved; in float value;
    uniform mat3 turn; uniform vec3 centre; uniform vec3 zoom; uniform vec2 shift; uniform vec4 sphere; uniform float along; uniform float stretch;
    out vec3 world; out vec3 facing; out float shade;
    void main() {
      world = sphere.w * place * vec3(1.0, 1.0, along) + sphere.xyz; facing = turn * normal; shade = value;
      vec3 seen = turn * (world + stretch * moved - centre);
      gl_Position = vec4(seen.xy * zoom.xy + shift, -seen.z * zoom.z, 1.0);
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    in vec3 world; in vec3 facing; in float shade;
    uniform sampler2D colours; uniform bool clip; uniform vec4 plane; uniform bool flatLight; uniform int mode; uniform float part;
    uniform vec3 plain; uniform bool byPart;
    out vec4 ink;
    void main() {
      if (clip && dot(plane.xyz, world) < plane.w) discard;
      if (mode == 1) { float t = floor(shade * 65535.0 + 0.5); ink = vec4(floor(t / 256.0) / 255.0, mod(t, 256.0) / 255.0, part / 255.0, 1.0); return; }
      if (mode == 2) { float d = floor(gl_FragCoord.z * 16777215.0); ink = vec4(floor(d / 65536.0), mod(floor(d / 256.0), 256.0), mod(d, 256.0), 255.0) / 255.0; return; }
      vec3 n = normalize(facing); if (n.z < 0.0) n = -n;
      float light = flatLight ? 1.0 : 0.46 + 0.42 * max(dot(n, normalize(vec3(-0.35, 0.55, 0.8))), 0.0) + 0.2 * max(dot(n, normalize(vec3(0.6, -0.5, 0.5))), 0.0);
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
  } catch (error) { giveUp("The interactive view did not start (" + error.message + ")."); return; }
  gl.useProgram(program);
  const at = {};
  ["turn", "centre", "zoom", "shift", "sphere", "along", "stretch", "colours", "clip", "plane", "flatLight", "mode", "part", "plain", "byPart"].forEach(function (n) { at[n] = gl.getUniformLocation(program, n); });
  const slot = {};
  ["place", "normal", "moved", "value"].forEach(function (n) { slot[n] = gl.getAttribLocation(program, n); });
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const luts = data.layers.map(function (layer) { return bytes(layer.colours); });
  const textures = luts.map(function (lut) {
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, lut);
    for (const [k, v] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) gl.texParameteri(gl.TEXTURE_2D, k, v);
    return texture;
  });
  function shape() { return { array: gl.createVertexArray(), buffer: {}, index: gl.createBuffer(), count: 0 }; }
  function fill(s, columns, index) {
    gl.bindVertexArray(s.array);
    for (const name in columns) {
      const size = name === "value" ? 1 : 3;
      if (slot[name] < 0) continue;
      if (!s.buffer[name]) s.buffer[name] = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, s.buffer[name]);
      gl.bufferData(gl.ARRAY_BUFFER, columns[name], gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(slot[name]); gl.vertexAttribPointer(slot[name], size, gl.FLOAT, false, 0, 0);
    }
    if (index) { gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, s.index); gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, index, gl.DYNAMIC_DRAW); s.count = index.length; }
    gl.bindVertexArray(null);
  }

  // ---------------------------------------------------------------- the data
  const mesh = { layers: [] };
  function unpack(raw) {
    const kinds = { u2: Uint16Array, i2: Int16Array, i1: Int8Array, i4: Int32Array }, column = {};
    let first = 0;
    data.columns.forEach(function (c) {
      const size = c[2] * kinds[c[1]].BYTES_PER_ELEMENT;
      column[c[0]] = new kinds[c[1]](raw.slice(first, first + size));
      first += size;
    });
    function summed(name) { const d = column[name], r = new Uint32Array(d.length); let s = 0; for (let i = 0; i < d.length; i++) { s += d[i]; r[i] = s; } return r; }
    const n = column.points.length / 3;
    mesh.points = new Float32Array(3 * n);
    for (let i = 0; i < n; i++) for (let k = 0; k < 3; k++) mesh.points[3 * i + k] = data.low[k] + column.points[k * n + i] / 65535 * data.span;
    mesh.moved = new Float32Array(3 * n);
    if (column.shift) for (let i = 0; i < n; i++) for (let k = 0; k < 3; k++) mesh.moved[3 * i + k] = column.shift[k * n + i] * data.shift_scale;
    mesh.vertex = summed("vertex"); mesh.triangles = summed("triangles"); mesh.caps = summed("caps"); mesh.tetrahedra = summed("tetrahedra");
    const v = mesh.vertex.length;
    mesh.normals = new Float32Array(3 * v);
    for (let i = 0; i < v; i++) for (let k = 0; k < 3; k++) mesh.normals[3 * i + k] = column.normals[k * v + i] / 127;
    data.layers.forEach(function (layer, l) {
      if (!layer.coloured) { mesh.layers.push(null); return; }
      const frames = [];
      for (let t = 0; t < layer.times; t++) {
        const f = column["layer" + l].slice(t * n, (t + 1) * n);
        if (t) for (let i = 0; i < n; i++) f[i] += frames[t - 1][i];
        frames.push(f);
      }
      mesh.layers.push(frames);
    });
  }
  function rounded(value, digits) { const text = value.toFixed(digits); return (parseFloat(text) === 0 ? text.replace("-", "") : text).replace("-", "−"); }
  function scaled(layer, value) { return (value - layer.low) / (layer.high - layer.low); }
  function restored(layer, share) { return layer.low + share * (layer.high - layer.low); }

  // ---------------------------------------------------------------- state
  const movable = function () { return mesh.tetrahedra.length > 0; };
  const flat = data.parts.length === 0;
  const state = { yaw: flat ? 0 : -0.423, pitch: flat ? 0 : 0.255, zoom: 1, x: 0, y: 0, open: !flat, hidden: new Set(), balls: true, places: true, layer: 0, time: 0, stretch: 0, around: 0, along: 0, depth: 0 };
  const start = Object.assign({}, state);
  const centre = data.low.map(function (v, k) { return v + data.size[k] / 2; });
  const solid = shape(), cut = shape(), ball = shape(), roller = shape(), tube = shape();
  let asked = false, stale = true;
  function plane() {
    // Kept is what lies on the side of the normal; at 0, 0, 0 the half with x above the axis.
    const c = Math.cos(state.along), n = [c * Math.cos(state.around), c * Math.sin(state.around), Math.sin(state.along)];
    const middle = movable() ? n[2] * centre[2] : 0, reach = (Math.abs(n[0]) * data.size[0] + Math.abs(n[1]) * data.size[1] + Math.abs(n[2]) * data.size[2]) / 2;
    return [n[0], n[1], n[2], middle + state.depth * reach];
  }
  function turn() {
    // Viewer at -x with z to the right and y up, then yaw about y and pitch about the screen's x.
    const c = Math.cos(state.yaw), s = Math.sin(state.yaw), d = Math.cos(state.pitch), e = Math.sin(state.pitch);
    const right = [s, 0, c], back = [-c, 0, s];
    const up = [-e * back[0], d, -e * back[2]], out = [d * back[0], e, d * back[2]];
    return [right[0], up[0], out[0], right[1], up[1], out[1], right[2], up[2], out[2]];
  }
  function current() { const frames = mesh.layers[state.layer]; return frames ? frames[Math.min(state.time, frames.length - 1)] : null; }
  function rolling() {
    const rollers = data.balls.filter(function (s) { return s.length; }).length;
    return rollers === data.balls.length ? "rollers" : rollers ? "balls and rollers" : "balls";
  }
  function valueOf(sphere) { const v = sphere.values[state.layer]; return v ? v[Math.min(state.time, v.length - 1)] : null; }

  // ---------------------------------------------------------------- the cut: marching tetrahedra
  const growing = { place: new Float32Array(0), moved: new Float32Array(0), value: new Float32Array(0) };
  function section(p, frame) {
    const q = mesh.points, m = mesh.moved, tets = mesh.tetrahedra, level = new Float32Array(q.length / 3), ranges = [];
    for (let i = 0; i < level.length; i++) { const d = p[0] * q[3 * i] + p[1] * q[3 * i + 1] + p[2] * q[3 * i + 2] - p[3]; level[i] = Math.abs(d) < 1e-7 ? 1e-7 : d; }
    let place = growing.place, moved = growing.moved, value = growing.value, used = 0;
    function corner(a, b) {
      if (used >= value.length) {
        const more = Math.max(12000, 2 * value.length), grown = [new Float32Array(3 * more), new Float32Array(3 * more), new Float32Array(more)];
        grown[0].set(place); grown[1].set(moved); grown[2].set(value);
        [place, moved, value] = grown; growing.place = place; growing.moved = moved; growing.value = value;
      }
      const w = level[a] / (level[a] - level[b]);
      for (let k = 0; k < 3; k++) { place[3 * used + k] = q[3 * a + k] + w * (q[3 * b + k] - q[3 * a + k]); moved[3 * used + k] = m[3 * a + k] + w * (m[3 * b + k] - m[3 * a + k]); }
      value[used] = frame ? (frame[a] + w * (frame[b] - frame[a])) / 65535 : 0;
      used++;
    }
    const front = [0, 0, 0, 0], behind = [0, 0, 0, 0];
    data.parts.forEach(function (part, i) {
      const first = used;
      if (!state.hidden.has(i)) for (let t = part.tetrahedra[0]; t < part.tetrahedra[0] + part.tetrahedra[1]; t++) {
        let f = 0, b = 0;
        for (let k = 0; k < 4; k++) { const node = tets[4 * t + k]; if (level[node] > 0) front[f++] = node; else behind[b++] = node; }
        if (f === 1) { corner(front[0], behind[0]); corner(front[0], behind[1]); corner(front[0], behind[2]); }
        else if (f === 3) { corner(behind[0], front[0]); corner(behind[0], front[1]); corner(behind[0], front[2]); }
        else if (f === 2) {
          corner(front[0], behind[0]); corner(front[0], behind[1]); corner(front[1], behind[1]);
          corner(front[0], behind[0]); corner(front[1], behind[1]); corner(front[1], behind[0]);
        }
      }
      ranges.push([first, used - first]);
    });
    const index = new Uint32Array(used);
    for (let i = 0; i < used; i++) index[i] = i;
    fill(cut, { place: place.subarray(0, 3 * used), moved: moved.subarray(0, 3 * used), value: value.subarray(0, used) }, index);
    cut.ranges = ranges;
  }
  function refresh() {
    stale = false;
    const frame = current(), n = mesh.vertex.length, value = new Float32Array(n);
    if (frame) for (let i = 0; i < n; i++) value[i] = frame[mesh.vertex[i]] / 65535;
    fill(solid, { value: value });
    if (movable() && state.open) section(plane(), frame);
  }
  function build() {
    const n = mesh.vertex.length, place = new Float32Array(3 * n), moved = new Float32Array(3 * n);
    for (let i = 0; i < n; i++) for (let k = 0; k < 3; k++) { place[3 * i + k] = mesh.points[3 * mesh.vertex[i] + k]; moved[3 * i + k] = mesh.moved[3 * mesh.vertex[i] + k]; }
    const index = new Uint32Array(mesh.triangles.length + mesh.caps.length);
    index.set(mesh.triangles); index.set(mesh.caps, mesh.triangles.length);
    fill(solid, { place: place, normal: mesh.normals, moved: moved }, index);
    const rings = 10, sides = 16, unit = [], faces = [];
    for (let i = 0; i <= rings; i++) for (let j = 0; j < sides; j++) { const a = Math.PI * i / rings, c = 2 * Math.PI * j / sides; unit.push(Math.sin(a) * Math.cos(c), Math.sin(a) * Math.sin(c), Math.cos(a)); }
    for (let i = 0; i < rings; i++) for (let j = 0; j < sides; j++) { const k = (j + 1) % sides, u = i * sides, v = u + sides; faces.push(u + j, v + j, v + k, u + j, v + k, u + k); }
    fill(ball, { place: new Float32Array(unit), normal: new Float32Array(unit) }, new Uint32Array(faces));
    cylinder();
    tubes();
  }
  function cylinder() {
    // A wall and two ends, each with its own normals: the rims are sharp.
    const sides = 32, place = [], normal = [], index = [];
    for (let ring = 0; ring < 4; ring++) for (let j = 0; j < sides; j++) {
      const c = 2 * Math.PI * j / sides, z = ring % 2 ? 1 : -1;
      place.push(Math.cos(c), Math.sin(c), z);
      if (ring < 2) normal.push(Math.cos(c), Math.sin(c), 0); else normal.push(0, 0, z);
    }
    for (let j = 0; j < sides; j++) {
      const k = (j + 1) % sides;
      index.push(j, k, k + sides, j, k + sides, j + sides);
      for (let end = 2; end < 4; end++) if (j && k) index.push(end * sides, end * sides + j, end * sides + k);
    }
    fill(roller, { place: new Float32Array(place), normal: new Float32Array(normal) }, new Uint32Array(index));
  }
  function tubes() {
    // A line as six sides, thin against the places that it joins.
    const place = [], normal = [], index = [], thick = 0.004 * data.span;
    data.links.forEach(function (link) {
      const d = [0, 1, 2].map(function (k) { return link[1][k] - link[0][k]; }), length = Math.hypot(d[0], d[1], d[2]) || 1;
      const e = Math.abs(d[0]) < 0.9 * length ? [1, 0, 0] : [0, 1, 0];
      const u = [d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]], w = Math.hypot(u[0], u[1], u[2]) || 1;
      const a = u.map(function (x) { return x / w; }), b = [(d[1] * a[2] - d[2] * a[1]) / length, (d[2] * a[0] - d[0] * a[2]) / length, (d[0] * a[1] - d[1] * a[0]) / length];
      const first = place.length / 3;
      for (let end = 0; end < 2; end++) for (let j = 0; j < 6; j++) for (let k = 0; k < 3; k++) {
        const n = a[k] * Math.cos(j * Math.PI / 3) + b[k] * Math.sin(j * Math.PI / 3);
        normal.push(n); place.push(link[end][k] + thick * n);
      }
      for (let j = 0; j < 6; j++) { const k = (j + 1) % 6; index.push(first + j, first + 6 + j, first + 6 + k, first + j, first + 6 + k, first + k); }
    });
    fill(tube, { place: new Float32Array(place), normal: new Float32Array(normal) }, new Uint32Array(index));
  }

  // ---------------------------------------------------------------- drawing
  const view = {};
  function look() {
    const w = canvas.width, h = canvas.height, m = turn();
    // Fitted on load and by the view buttons only, so that turning does not pump the size.
    if (!state.fit) {
      let wide = 1e-9, tall = 1e-9;
      const q = mesh.points;
      for (let i = 0; i < q.length; i += 3) {
        const x = q[i] - centre[0], y = q[i + 1] - centre[1], z = q[i + 2] - centre[2];
        wide = Math.max(wide, Math.abs(m[0] * x + m[3] * y + m[6] * z)); tall = Math.max(tall, Math.abs(m[1] * x + m[4] * y + m[7] * z));
      }
      state.fit = (flat ? 0.75 : 0.95) * Math.min(w / h / wide, 1 / tall);
    }
    const fit = state.fit * state.zoom;
    view.turn = m; view.zoom = [fit * h / w, fit, 0.45 / Math.hypot(data.size[0], data.size[1], data.size[2])];
  }
  function onScreen(p) {
    const m = view.turn, d = [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]];
    const x = (m[0] * d[0] + m[3] * d[1] + m[6] * d[2]) * view.zoom[0] + state.x, y = (m[1] * d[0] + m[4] * d[1] + m[7] * d[2]) * view.zoom[1] + state.y;
    return [(x + 1) / 2 * canvas.clientWidth, (1 - y) / 2 * canvas.clientHeight];
  }
  function kept(p, place) { return !state.open || p[0] * place[0] + p[1] * place[1] + p[2] * place[2] > p[3] - 1e-6; }
  function spheres(list, part, visible, scale) {
    gl.uniform1i(at.clip, 0); gl.uniform1i(at.flatLight, 0);
    list.forEach(function (s, i) {
      if (!visible(s)) return;
      const drawn = s.length ? roller : ball;
      gl.bindVertexArray(drawn.array); gl.disableVertexAttribArray(slot.moved); gl.vertexAttrib3f(slot.moved, 0, 0, 0);
      gl.uniform1f(at.along, s.length ? 0.5 * s.length / s.radius : 1);
      const value = valueOf(s);
      gl.uniform1i(at.byPart, value === null ? 1 : 0); gl.uniform3f(at.plain, 0.55, 0.58, 0.62);
      gl.vertexAttrib1f(slot.value, value === null ? 0 : scaled(data.layers[state.layer], value));
      gl.uniform4f(at.sphere, s.place[0], s.place[1], s.place[2], s.radius * (scale || 1));
      gl.uniform1f(at.part, part);
      gl.drawElements(gl.TRIANGLES, drawn.count, gl.UNSIGNED_INT, 0);
    });
    gl.uniform4f(at.sphere, 0, 0, 0, 1); gl.uniform1f(at.along, 1);
  }
  function draw(mode) {
    if (stale) refresh();
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(1, 1, 1, mode ? 0 : 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    look();
    const p = plane(), plain = current() === null;
    gl.bindTexture(gl.TEXTURE_2D, textures[state.layer]);
    gl.uniformMatrix3fv(at.turn, false, view.turn); gl.uniform3fv(at.centre, centre); gl.uniform3fv(at.zoom, view.zoom);
    gl.uniform2f(at.shift, state.x, state.y); gl.uniform4f(at.sphere, 0, 0, 0, 1); gl.uniform1f(at.along, 1); gl.uniform1f(at.stretch, state.stretch);
    gl.uniform4fv(at.plane, p); gl.uniform1i(at.mode, mode); gl.uniform1i(at.byPart, plain ? 1 : 0); gl.uniform3f(at.plain, 0.8, 0.82, 0.85);
    data.parts.forEach(function (part, i) {
      if (state.hidden.has(i)) return;
      gl.uniform1f(at.part, i);
      gl.bindVertexArray(solid.array); gl.uniform1i(at.clip, state.open ? 1 : 0); gl.uniform1i(at.flatLight, 0);
      gl.drawElements(gl.TRIANGLES, 3 * part.triangles[1], gl.UNSIGNED_INT, 12 * part.triangles[0]);
      if (!state.open) return;
      gl.uniform1i(at.clip, 0); gl.uniform1i(at.flatLight, 1);
      if (plain) gl.uniform3f(at.plain, 0.9, 0.91, 0.93);
      if (movable()) {
        const range = cut.ranges[i];
        gl.bindVertexArray(cut.array); gl.vertexAttrib3f(slot.normal, 0, 0, 1);
        if (range[1]) gl.drawElements(gl.TRIANGLES, range[1], gl.UNSIGNED_INT, 4 * range[0]);
      } else if (part.caps[1]) gl.drawElements(gl.TRIANGLES, 3 * part.caps[1], gl.UNSIGNED_INT, 4 * mesh.triangles.length + 12 * part.caps[0]);
      if (plain) gl.uniform3f(at.plain, 0.8, 0.82, 0.85);
    });
    if (state.balls) spheres(data.balls, 254, function (s) { return kept(p, s.place); });
    if (tube.count) {
      gl.bindVertexArray(tube.array); gl.uniform1i(at.byPart, 1); gl.uniform3f(at.plain, 0.6, 0.63, 0.67); gl.uniform1f(at.part, 253);
      gl.uniform1i(at.clip, 0); if (mode !== 1) gl.drawElements(gl.TRIANGLES, tube.count, gl.UNSIGNED_INT, 0);
    }
    if (state.places && mode !== 2) {
      // Probes lie within the metal: they are drawn over it, each in a dark rim.
      gl.disable(gl.DEPTH_TEST);
      if (mode === 0) {
        const layer = state.layer;
        data.places.forEach(function (s) {
          gl.bindVertexArray(ball.array); gl.uniform1i(at.byPart, 1); gl.uniform3f(at.plain, 0.11, 0.15, 0.2); gl.uniform1i(at.flatLight, 1); gl.uniform1i(at.clip, 0);
          gl.uniform4f(at.sphere, s.place[0], s.place[1], s.place[2], 1.22 * s.radius);
          gl.drawElements(gl.TRIANGLES, ball.count, gl.UNSIGNED_INT, 0);
          gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.ALWAYS);
          spheres([s], 252, function () { return true; });
          gl.depthFunc(gl.LESS); gl.disable(gl.DEPTH_TEST);
        });
        gl.uniform4f(at.sphere, 0, 0, 0, 1);
      }
      gl.enable(gl.DEPTH_TEST);
    }
    if (mode === 0) label();
  }
  function label() {
    names.textContent = "";
    picked.forEach(function (entry) {
      if (!entry.at) return;
      const mark = document.createElement("i"), where = onScreen(entry.at);
      mark.style.left = where[0] + "px"; mark.style.top = where[1] + "px"; mark.style.borderColor = entry.colour;
      names.append(mark);
    });
    if (!state.places) return;
    const taken = [];
    data.places.map(function (s) { return [s, onScreen(s.place)]; }).sort(function (a, b) { return b[1][1] - a[1][1]; }).forEach(function (pair) {
      const s = pair[0], where = pair[1].slice(), value = valueOf(s), digits = data.layers[state.layer].difference ? 2 : 1;
      const tag = document.createElement("span");
      tag.textContent = s.name + (value === null ? "" : " " + rounded(value, digits));
      // Names that would cover one another stand above one another.
      const wide = 7 * tag.textContent.length + 10, tall = 18;
      let free = false;
      while (!free) {
        free = taken.every(function (t) { return where[0] + wide < t[0] || where[0] > t[1] || Math.abs(where[1] - t[2]) >= tall; });
        if (!free) where[1] -= 4;
      }
      taken.push([where[0], where[0] + wide, where[1]]);
      tag.className = picked.has("place " + s.name) ? "chosen" : "";
      tag.style.left = where[0] + "px"; tag.style.top = where[1] + "px";
      names.append(tag);
    });
  }
  function resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), w = Math.round(canvas.clientWidth * ratio), h = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  }
  function redraw(again) { if (again) stale = true; if (!asked) { asked = true; requestAnimationFrame(function () { asked = false; resize(); draw(0); host.dataset.drawn = "yes"; }); } }

  // ---------------------------------------------------------------- reading and picking
  function pixelAt(event, mode) {
    const box = canvas.getBoundingClientRect(), pixel = new Uint8Array(4);
    const x = Math.floor((event.clientX - box.left) / box.width * canvas.width), y = Math.floor((box.bottom - event.clientY) / box.height * canvas.height);
    draw(mode); gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); draw(0);
    return { pixel: pixel, x: 2 * (x + 0.5) / canvas.width - 1, y: 2 * (y + 0.5) / canvas.height - 1 };
  }
  const HINT = readout.textContent;
  function readAt(event) {
    const near = placeNear(event), layer = data.layers[state.layer];
    if (near) { const v = valueOf(near); readout.textContent = near.name + (v === null ? "" : ": " + rounded(v, 2) + " " + layer.unit); return; }
    const pixel = pixelAt(event, 1).pixel;
    if (!pixel[3] || (current() === null && pixel[2] < 252)) { readout.textContent = HINT; return; }
    const name = pixel[2] === 254 ? rolling() : (data.parts[pixel[2]] || { name: "" }).name;
    readout.textContent = name + ": " + rounded(restored(layer, (pixel[0] * 256 + pixel[1]) / 65535), layer.difference ? 2 : 1) + " " + layer.unit;
  }
  function placeNear(event) {
    if (!state.places) return null;
    const box = canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    let best = null, least = flat ? 24 : 12;
    data.places.forEach(function (s) { const w = onScreen(s.place), d = Math.hypot(w[0] - x, w[1] - y); if (d < least) { least = d; best = s; } });
    return best;
  }
  function nodeAt(event) {
    const found = pixelAt(event, 2);
    if (!found.pixel[3]) return -1;
    const depth = (found.pixel[0] * 65536 + found.pixel[1] * 256 + found.pixel[2]) / 16777215, m = view.turn;
    const s = [(found.x - state.x) / view.zoom[0], (found.y - state.y) / view.zoom[1], -(2 * depth - 1) / view.zoom[2]];
    const p = [0, 1, 2].map(function (k) { return centre[k] + m[3 * k] * s[0] + m[3 * k + 1] * s[1] + m[3 * k + 2] * s[2]; });
    const q = mesh.points, v = mesh.moved;
    let best = -1, least = Infinity;
    for (let i = 0; i < q.length / 3; i++) {
      let d = 0;
      for (let k = 0; k < 3; k++) { const e = q[3 * i + k] + state.stretch * v[3 * i + k] - p[k]; d += e * e; }
      if (d < least) { least = d; best = i; }
    }
    return best;
  }

  // ---------------------------------------------------------------- histories of what was clicked
  const picked = new Map(), CYCLE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8c6d31", "#6b6b6b"], DASHES = ["", "7 3", "2 3", "9 3 2 3"];
  function pick(event) {
    const near = placeNear(event);
    let key, entry;
    if (near) {
      key = "place " + near.name;
      const known = data.histories[near.name] || (data.times.length > 1 ? data.layers.map(function (layer, l) { return { name: layer.name, times: data.times, values: near.values[l] }; }).filter(function (c, l) { return c.values && !data.layers[l].difference; }) : []);
      entry = { title: near.name, curves: known, value: valueOf(near) };
    } else {
      const node = current() ? nodeAt(event) : -1;
      if (node < 0) return;
      const p = [0, 1, 2].map(function (k) { return mesh.points[3 * node + k]; });
      key = "node " + node;
      const curves = [];
      if (data.times.length > 1) data.layers.forEach(function (layer, l) {
        if (mesh.layers[l] && !layer.difference) curves.push({ name: layer.name, times: data.times, values: mesh.layers[l].map(function (f) { return restored(layer, f[node] / 65535); }) });
      });
      entry = { title: "r " + (1000 * Math.hypot(p[0], p[1])).toFixed(0) + ", z " + (1000 * p[2]).toFixed(0) + " mm", curves: curves, value: restored(data.layers[state.layer], current()[node] / 65535), at: p };
    }
    if (picked.has(key)) picked.delete(key); else picked.set(key, entry);
    plot(); redraw();
  }
  function put(parent, kind, attributes, text) {
    const e = document.createElementNS("http://www.w3.org/2000/svg", kind);
    for (const k in attributes) e.setAttribute(k, attributes[k]);
    if (text !== undefined) e.textContent = text;
    parent.append(e);
    return e;
  }
  function steps(low, high, most) {
    const raw = (high - low) / most || 1, power = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map(function (f) { return f * power; }).find(function (s) { return s >= raw; }), found = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) found.push(Number(v.toPrecision(10)));
    return found;
  }
  function clock() {
    const last = Math.max.apply(null, data.times.concat(0));
    return last > 172800 ? [86400, "d"] : last > 5400 ? [3600, "h"] : last > 180 ? [60, "min"] : [1, "s"];
  }
  function plot() {
    const panel = find(".view3d-chart"), list = find(".view3d-picked"), svg = find(".view3d-chart svg");
    list.textContent = ""; svg.textContent = "";
    const curves = [];
    let n = 0;
    picked.forEach(function (entry, key) {
      const item = document.createElement("li"), colour = entry.colour = CYCLE[n++ % CYCLE.length];
      item.textContent = entry.title + (entry.value === null || entry.value === undefined || data.times.length > 1 ? "" : ": " + rounded(entry.value, 2) + " " + data.layers[state.layer].unit);
      item.style.color = colour;
      list.append(item);
      entry.curves.forEach(function (c, k) { curves.push({ name: entry.title + ", " + c.name, colour: colour, dash: DASHES[k % DASHES.length], times: c.times, values: c.values, several: entry.curves.length > 1 }); });
    });
    panel.hidden = picked.size === 0; svg.style.display = curves.length ? "" : "none";
    if (!curves.length) return;
    const wide = 960, tall = 300, left = 58, right = 14, top = 12, foot = 42, unit = clock();
    let t0 = Infinity, t1 = -Infinity, v0 = Infinity, v1 = -Infinity;
    curves.forEach(function (c) { c.values.forEach(function (v, i) { if (v === null) return; t0 = Math.min(t0, c.times[i]); t1 = Math.max(t1, c.times[i]); v0 = Math.min(v0, v); v1 = Math.max(v1, v); }); });
    if (!(t1 > t0)) t1 = t0 + 1;
    const pad = 0.05 * (v1 - v0) + 0.02; v0 -= pad; v1 += pad;
    const X = function (t) { return left + (t - t0) / (t1 - t0) * (wide - left - right); }, Y = function (v) { return tall - foot - (v - v0) / (v1 - v0) * (tall - top - foot); };
    steps(v0, v1, 5).forEach(function (v) { put(svg, "line", { x1: left, x2: wide - right, y1: Y(v), y2: Y(v), stroke: "#dfe4e9" }); put(svg, "text", { x: left - 8, y: Y(v) + 4, "text-anchor": "end" }, String(v)); });
    steps(t0 / unit[0], t1 / unit[0], 8).forEach(function (t) { put(svg, "line", { x1: X(t * unit[0]), x2: X(t * unit[0]), y1: top, y2: tall - foot, stroke: "#eef1f4" }); put(svg, "text", { x: X(t * unit[0]), y: tall - foot + 18, "text-anchor": "middle" }, String(t)); });
    put(svg, "text", { x: (left + wide) / 2, y: tall - 6, "text-anchor": "middle" }, "time / " + unit[1]);
    put(svg, "text", { x: 14, y: (tall - foot) / 2, transform: "rotate(-90 14 " + (tall - foot) / 2 + ")", "text-anchor": "middle" }, "temperature / " + data.layers[0].unit);
    const chosen = data.times[state.time];
    if (data.times.length > 1) put(svg, "line", { x1: X(chosen), x2: X(chosen), y1: top, y2: tall - foot, stroke: "#1d2733", "stroke-width": 1 });
    curves.forEach(function (c) {
      let path = "", pen = false;
      c.values.forEach(function (v, i) { if (v === null) { pen = false; return; } path += (pen ? "L" : "M") + X(c.times[i]).toFixed(1) + " " + Y(v).toFixed(1); pen = true; });
      const line = put(svg, "path", { d: path, fill: "none", stroke: c.colour, "stroke-width": 2, "stroke-dasharray": c.dash });
      put(line, "title", {}, c.name);
    });
    const kinds = new Map();
    curves.forEach(function (c) { if (c.several) kinds.set(c.dash, c.name.slice(c.name.lastIndexOf(", ") + 2)); });
    let x = left + 12;
    kinds.forEach(function (name, dash) {
      put(svg, "line", { x1: x, x2: x + 34, y1: top + 8, y2: top + 8, stroke: "#1d2733", "stroke-width": 2, "stroke-dasharray": dash });
      put(svg, "text", { x: x + 40, y: top + 12 }, name); x += 60 + 8 * name.length;
    });
  }

  // ---------------------------------------------------------------- controls
  function show(what, on) { const e = find(what); if (e) e.hidden = !on; return e; }
  function range(what, act) { const e = find(what); if (e) e.addEventListener("input", function () { act(parseFloat(e.value)); }); return e; }
  function timeText() {
    const t = data.times[state.time], h = Math.floor(t / 3600), m = Math.floor(t % 3600 / 60), s = Math.round(t % 60);
    return h ? h + " h " + String(m).padStart(2, "0") + " min" : m ? m + " min " + String(s).padStart(2, "0") + " s" : s + " s";
  }
  function setTime(k) {
    state.time = k; find("[data-time]").value = k; find(".view3d-clock").textContent = timeText();
    redraw(true); if (picked.size) plot();
  }
  function controls() {
    let drag = null;
    canvas.addEventListener("pointerdown", function (e) { drag = { x: e.clientX, y: e.clientY, pan: e.shiftKey || e.button !== 0, far: 0 }; canvas.setPointerCapture(e.pointerId); });
    canvas.addEventListener("pointerup", function (e) { if (drag && drag.far < 4 && !drag.pan) pick(e); drag = null; });
    canvas.addEventListener("contextmenu", function (e) { e.preventDefault(); });
    canvas.addEventListener("pointermove", function (e) {
      if (!drag) { readAt(e); return; }
      const dx = e.clientX - drag.x, dy = e.clientY - drag.y; drag.x = e.clientX; drag.y = e.clientY; drag.far += Math.abs(dx) + Math.abs(dy);
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
      b.hidden = flat && b.dataset.view !== "start";
    });
    host.querySelectorAll("[data-zoom]").forEach(function (b) { b.addEventListener("click", function () { state.zoom *= parseFloat(b.dataset.zoom); redraw(); }); });
    find("[data-open]").addEventListener("change", function (e) { state.open = e.target.checked; show(".view3d-cut", state.open && movable()); redraw(true); });
    find("[data-open]").closest("label").hidden = flat;
    cutControls(); layerControls(); timeControls(); growthControls(); partControls();
    const marks = find("[data-places]");
    marks.closest("label").hidden = flat || !data.places.length;
    marks.addEventListener("change", function () { state.places = marks.checked; redraw(); });
    find("[data-clear]").addEventListener("click", function () { picked.clear(); plot(); redraw(); });
    window.addEventListener("resize", function () { state.fit = 0; redraw(); });
  }
  function cutControls() {
    show(".view3d-cut", movable());
    const around = range("[data-around]", function (v) { state.around = v * Math.PI / 180; said(); }), along = range("[data-along]", function (v) { state.along = v * Math.PI / 180; said(); });
    const depth = range("[data-depth]", function (v) { state.depth = v; said(); });
    function said() {
      const p = plane();
      find(".view3d-plane").textContent = "cut at " + (1000 * p[3]).toFixed(0) + " mm along (" + p.slice(0, 3).map(function (v) { return v.toFixed(2); }).join(", ") + ")";
      redraw(true);
    }
    host.querySelectorAll("[data-normal]").forEach(function (b) {
      b.addEventListener("click", function () {
        const angles = b.dataset.normal.split(" ");
        around.value = angles[0]; along.value = angles[1]; depth.value = 0;
        state.around = angles[0] * Math.PI / 180; state.along = angles[1] * Math.PI / 180; state.depth = 0;
        said();
      });
    });
    find("[data-flip]").addEventListener("click", function () {
      // The opposite direction at the same place: what was taken away is what is left.
      const a = parseFloat(around.value);
      around.value = a > 0 ? a - 180 : a + 180; along.value = -along.value;
      const before = plane();
      state.around = around.value * Math.PI / 180; state.along = along.value * Math.PI / 180; state.depth = 0;
      const after = plane(), reach = (Math.abs(after[0]) * data.size[0] + Math.abs(after[1]) * data.size[1] + Math.abs(after[2]) * data.size[2]) / 2;
      state.depth = (-before[3] - after[3]) / reach; depth.value = state.depth;
      said();
    });
    if (movable()) said();
  }
  function layerControls() {
    const box = show(".view3d-layer", data.layers.length > 1), choice = find(".view3d-layer select");
    data.layers.forEach(function (layer, i) { const o = document.createElement("option"); o.value = i; o.textContent = layer.name; choice.append(o); });
    choice.addEventListener("change", function () { state.layer = parseInt(choice.value, 10); legend(); redraw(true); });
    return box;
  }
  function timeControls() {
    show(".view3d-time", data.times.length > 1);
    if (data.times.length < 2) return;
    const slider = range("[data-time]", function (v) { setTime(Math.round(v)); }), play = find("[data-play]");
    slider.max = data.times.length - 1;
    let going = null;
    play.addEventListener("click", function () {
      if (going) { clearInterval(going); going = null; play.textContent = "Play"; return; }
      play.textContent = "Stop";
      if (state.time === data.times.length - 1) setTime(0);
      going = setInterval(function () {
        if (state.time >= data.times.length - 1) { clearInterval(going); going = null; play.textContent = "Play"; return; }
        setTime(state.time + 1);
      }, 250);
    });
    setTime(data.times.length - 1);
  }
  function growthControls() {
    show(".view3d-growth", data.shifted);
    if (!data.shifted) return;
    const slider = find("[data-stretch]"), said = find(".view3d-stretched");
    slider.max = 2 * data.exaggeration; slider.step = data.exaggeration / 50;
    function act() {
      state.stretch = parseFloat(slider.value);
      said.textContent = state.stretch ? "drawn " + state.stretch.toFixed(0) + " times larger; largest shift " + data.largest_shift_um.toFixed(0) + " µm" : "as assembled; largest shift " + data.largest_shift_um.toFixed(0) + " µm";
      redraw();
    }
    slider.addEventListener("input", act);
    find("[data-grown]").addEventListener("click", function () { slider.value = state.stretch ? 0 : data.exaggeration; act(); });
    act();
  }
  function partControls() {
    const list = find(".view3d-parts");
    data.parts.concat(data.balls.length ? [{ name: rolling() }] : []).forEach(function (p, i) {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox"; box.checked = true;
      box.addEventListener("change", function () {
        if (i === data.parts.length) state.balls = box.checked; else if (box.checked) state.hidden.delete(i); else state.hidden.add(i);
        redraw(true);
      });
      label.append(box, document.createTextNode(" " + p.name)); list.append(label);
    });
    list.closest("details").hidden = flat;
  }
  function legend() {
    const bar = find(".view3d-bar"), stops = [], lut = luts[state.layer], layer = data.layers[state.layer];
    for (let i = 0; i <= 32; i++) { const k = Math.min(255, i * 8); stops.push("rgb(" + lut[3 * k] + "," + lut[3 * k + 1] + "," + lut[3 * k + 2] + ")"); }
    bar.style.background = "linear-gradient(to right," + stops.join(",") + ")";
    const ticks = find(".view3d-ticks"), digits = layer.high - layer.low < 2 ? 2 : 1;
    ticks.textContent = "";
    for (let i = 0; i <= 5; i++) { const s = document.createElement("span"); s.textContent = rounded(restored(layer, i / 5), digits) + (i === 5 ? " " + layer.unit : ""); ticks.append(s); }
    find(".view3d-scale").textContent = layer.name + " / " + layer.unit;
  }
  data.notes.forEach(function (text) { const line = document.createElement("p"); line.className = "view3d-note"; line.textContent = text; host.append(line); });
  inflate(bytes(data.block)).then(function (raw) {
    unpack(raw); build(); controls(); legend(); redraw(true);
  }).catch(function (error) { giveUp("The interactive view could not be unpacked (" + error.message + ")."); });
})();
