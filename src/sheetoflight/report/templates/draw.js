// Draws the figures in the colours of the reader's theme.
"use strict";
(function () {
  const themes = {
    light: { ink: "#1d2329", grid: "#dde2e7", axis: "#98a2ad" },
    dark: { ink: "#dfe4ea", grid: "#363d45", axis: "#6d7782" },
    // A sheet of A4 or Letter between its margins; the window may be wider.
    paper: { ink: "#1d2329", grid: "#dde2e7", axis: "#98a2ad", width: 660 },
  };
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  // No button may send a reader's data to a service.
  const settings = {
    displaylogo: false,
    responsive: true,
    scrollZoom: false,
    showSendToCloud: false,
    plotlyServerURL: "",
    modeBarButtonsToRemove: [
      "select2d", "lasso2d", "zoomIn2d", "zoomOut2d", "autoScale2d", "tableRotation",
    ],
  };
  // Browsers keep some sixteen drawings in space alive and drop the oldest beyond that, so
  // further ones are drawn when they come near the window.
  const mostInSpace = 8;
  const inSpace = [];
  const shown = new Set();

  function themed(layout, theme) {
    const axis = { gridcolor: theme.grid, linecolor: theme.axis, zerolinecolor: theme.axis };
    const merged = Object.assign({}, layout, {
      font: { color: theme.ink, family: "system-ui, sans-serif", size: 13 },
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      modebar: { orientation: "v", bgcolor: "rgba(0,0,0,0)", color: theme.axis, activecolor: theme.ink },
      hoverlabel: { align: "left" },
      // The buttons stand at the right, beside the legend and not upon it.
      margin: { l: 56, r: 36, t: 36, b: 48 },
      legend: Object.assign({ orientation: "h", y: 1, yanchor: "bottom", x: 0 }, layout.legend),
      autosize: !theme.width,
      width: theme.width,
    });
    if (layout.scene) {
      const scene = Object.assign({}, layout.scene);
      for (const name of ["xaxis", "yaxis", "zaxis"]) {
        const look = { showbackground: false, color: theme.ink };
        scene[name] = Object.assign({}, axis, layout.scene[name], look);
      }
      merged.scene = scene;
      merged.margin = { l: 0, r: 36, t: 0, b: 0 };
    } else {
      merged.xaxis = Object.assign({ automargin: true }, axis, layout.xaxis);
      merged.yaxis = Object.assign({ automargin: true }, axis, layout.yaxis);
    }
    return merged;
  }

  function draw(plot, theme) {
    const source = document.querySelector('script[data-for="' + plot.id + '"]');
    const figure = JSON.parse(source.textContent);
    if (plot.layout && plot.layout.scene) {
      figure.layout.scene.camera = plot.layout.scene.camera;
    }
    window.Plotly.react(plot, figure.data, themed(figure.layout, theme), settings);
    shown.add(plot);
    if (figure.layout.scene) {
      keepFew(plot);
    }
  }

  function keepFew(plot) {
    const known = inSpace.indexOf(plot);
    if (known >= 0) {
      inSpace.splice(known, 1);
    }
    inSpace.push(plot);
    if (inSpace.length > mostInSpace) {
      const oldest = inSpace.shift();
      window.Plotly.purge(oldest);
      shown.delete(oldest);
    }
  }

  function current() {
    return dark.matches ? themes.dark : themes.light;
  }

  const plots = Array.from(document.querySelectorAll(".plot"));
  const watcher = new IntersectionObserver(
    function (entries) {
      for (const entry of entries) {
        if (entry.isIntersecting && !shown.has(entry.target)) {
          draw(entry.target, current());
        }
      }
    },
    { rootMargin: "400px" }
  );
  plots.forEach(function (plot) {
    if (!plot.classList.contains("space") || inSpace.length < mostInSpace) {
      draw(plot, current());
    }
    watcher.observe(plot);
  });

  dark.addEventListener("change", function () {
    Array.from(shown).forEach(function (plot) { draw(plot, current()); });
  });
  window.addEventListener("beforeprint", function () {
    plots.forEach(function (plot) { draw(plot, themes.paper); });
  });
  window.addEventListener("afterprint", function () {
    Array.from(shown).forEach(function (plot) { draw(plot, current()); });
  });
})();
