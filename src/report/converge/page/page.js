"use strict";
(() => {
    // Narrower than this, labels at the ends of curves leave no room for the curves.
    const LABELLED_WIDTH = 480;

    const plots = JSON.parse(document.getElementById("plots").textContent);
    const measure = document.getElementById("measure");
    const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] };

    // The layout in the colours of the page, which follow the reader's theme.
    const themed = (layout, width) => {
        const style = getComputedStyle(document.documentElement);
        const color = (name) => style.getPropertyValue(name).trim();
        // Of a decade in per cent, 2 and 5 are labelled alone: "D2".
        const steps = (axis) => (axis.type === "log" && axis.tickformat ? { dtick: "D2" } : {});
        const axis = (axis) => ({ ...axis, ...steps(axis), gridcolor: color("--line"), linecolor: color("--line") });
        const narrow = width < LABELLED_WIDTH;
        return {
            ...layout,
            font: { color: color("--ink"), size: 12, family: "system-ui, sans-serif" },
            paper_bgcolor: "rgba(0,0,0,0)",
            plot_bgcolor: "rgba(0,0,0,0)",
            xaxis: axis(layout.xaxis),
            yaxis: axis(layout.yaxis),
            modebar: { bgcolor: "rgba(0,0,0,0)", color: color("--faint"), activecolor: color("--ink") },
            annotations: narrow ? [] : layout.annotations,
            margin: narrow ? { ...layout.margin, r: 16 } : layout.margin,
            hoverlabel: { bgcolor: color("--panel"), bordercolor: color("--line"), font: { color: color("--ink") } },
        };
    };

    const draw = (id, plot) => {
        const element = document.getElementById(id);
        // A copy: the library writes into what it is given.
        const { data, layout } = structuredClone(plot);
        return Plotly.react(element, data, themed(layout, element.clientWidth), config);
    };

    const drawAll = () => {
        const { time, samples } = plots.measures[measure.selectedIndex];
        const drawn = [draw("by-time", time), draw("by-samples", samples)];
        if (plots.stages) {
            drawn.push(draw("by-stage", plots.stages));
        }
        Promise.all(drawn).then(() => document.body.setAttribute("data-drawn", measure.value));
    };

    measure.addEventListener("change", drawAll);
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
    let width = window.innerWidth;
    window.addEventListener("resize", () => {
        if (window.innerWidth !== width) {
            width = window.innerWidth;
            drawAll();
        }
    });
    drawAll();
})();
