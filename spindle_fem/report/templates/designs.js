(function () {
  "use strict";
  var data = JSON.parse(document.getElementById("sweep-data").textContent);
  var svg = document.getElementById("sweep-chart"), detail = document.getElementById("sweep-detail");
  var pick = [document.getElementById("sweep-x"), document.getElementById("sweep-y")];
  var left = 80, right = 875, top = 20, bottom = 415;
  function make(tag, attributes, text) {
    var item = document.createElementNS("http://www.w3.org/2000/svg", tag);
    Object.keys(attributes).forEach(function (key) { item.setAttribute(key, attributes[key]); });
    if (text !== undefined) { item.textContent = text; }
    svg.appendChild(item);
    return item;
  }
  function range(column) {
    var values = data.designs.map(function (d) { return d.values[column]; }).filter(function (v) { return v !== null; });
    var low = Math.min.apply(null, values), high = Math.max.apply(null, values), margin = 0.05 * (high - low) || 0.5;
    return [low - margin, high + margin];
  }
  function show(design, dot) {
    svg.querySelectorAll("circle").forEach(function (c) { c.setAttribute("r", 6); });
    dot.setAttribute("r", 10);
    detail.textContent = "";
    var table = document.createElement("table"), body = table.createTBody();
    [["design", design.number + (design.feasible ? "" : " (breaks a limit)")]].concat(
      data.columns.map(function (name, i) { return [name, design.values[i]]; })
    ).forEach(function (pair) {
      var row = body.insertRow(), head = document.createElement("th");
      head.textContent = pair[0]; row.appendChild(head);
      var cell = row.insertCell(); cell.className = "n"; cell.textContent = pair[1] === null ? "–" : pair[1];
    });
    detail.appendChild(table);
  }
  function draw() {
    svg.textContent = "";
    var columns = pick.map(function (p) { return +p.value; }), x = range(columns[0]), y = range(columns[1]);
    function across(v) { return left + (v - x[0]) / (x[1] - x[0]) * (right - left); }
    function up(v) { return bottom - (v - y[0]) / (y[1] - y[0]) * (bottom - top); }
    for (var i = 0; i <= 5; i += 1) {
      var vx = x[0] + i * (x[1] - x[0]) / 5, vy = y[0] + i * (y[1] - y[0]) / 5;
      make("line", {x1: across(vx), x2: across(vx), y1: top, y2: bottom, stroke: "#dfe4e9"});
      make("line", {x1: left, x2: right, y1: up(vy), y2: up(vy), stroke: "#dfe4e9"});
      make("text", {x: across(vx), y: bottom + 20, "text-anchor": "middle", "font-size": 13}, +vx.toPrecision(4));
      make("text", {x: left - 8, y: up(vy) + 4, "text-anchor": "end", "font-size": 13}, +vy.toPrecision(4));
    }
    make("text", {x: (left + right) / 2, y: 460, "text-anchor": "middle", "font-size": 14}, data.columns[columns[0]]);
    make("text", {x: 16, y: (top + bottom) / 2, "text-anchor": "middle", "font-size": 14,
      transform: "rotate(-90 16 " + (top + bottom) / 2 + ")"}, data.columns[columns[1]]);
    data.designs.forEach(function (d) {
      if (d.values[columns[0]] === null || d.values[columns[1]] === null) { return; }
      var dot = make("circle", {cx: across(d.values[columns[0]]), cy: up(d.values[columns[1]]), r: 6, tabindex: 0, role: "button",
        "aria-label": "design " + d.number, fill: d.feasible ? "#0072B2" : "#ffffff", "fill-opacity": 0.75,
        stroke: data.front.indexOf(d.number) >= 0 ? "#D55E00" : "#5b6875",
        "stroke-width": data.front.indexOf(d.number) >= 0 ? 3 : 1, style: "cursor:pointer"});
      dot.addEventListener("click", function () { show(d, dot); });
      dot.addEventListener("focus", function () { show(d, dot); });
      dot.addEventListener("keydown", function (event) {
        var step = {ArrowRight: "nextElementSibling", ArrowLeft: "previousElementSibling"}[event.key];
        if (step && dot[step] && dot[step].tagName === "circle") { event.preventDefault(); dot[step].focus(); }
      });
    });
  }
  pick.forEach(function (select, which) {
    data.columns.forEach(function (name, i) {
      var option = document.createElement("option");
      option.value = i; option.textContent = name; option.selected = i === data.start[which];
      select.appendChild(option);
    });
    select.addEventListener("change", draw);
  });
  if (data.designs.length && data.columns.length) { draw(); }
}());
