//! The page of a comparison: complete, self-contained, and alive in a browser.

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::LazyLock;

use serde_json::Value;
use tempfile::TempDir;
use wavepath::report::converge::Results;

use crate::browser::{Page, chromium};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.toml");

/// A name that would run if it were not escaped.
const HOSTILE: &str = "</script><script>alert(1)</script><img src>&amp;$x$";

/// A small comparison, made once for all tests.
struct Made {
    folder: TempDir,
    results: Results,
    html: String,
}

static MADE: LazyLock<Made> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_wavepath"))
        .current_dir(folder.path())
        .args([
            "converge",
            SCENE,
            "--width=24",
            "--height=16",
            "--threads=1",
        ])
        .args([
            "--spp=32",
            "--repeats=3",
            "--reference-error=0.05",
            "--cache=cache",
            "--out=out",
        ])
        .args(["--config", "plain=strategy=mis"])
        .args(["--config", &format!("{HOSTILE}=strategy=nee,accel=bvh8")])
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let read = |file: &str| fs::read_to_string(folder.path().join("out").join(file)).unwrap();
    Made {
        results: serde_json::from_str(&read("converge.json")).unwrap(),
        html: read("index.html"),
        folder,
    }
});

impl Made {
    fn page(&self) -> PathBuf {
        self.folder.path().join("out/index.html")
    }

    /// The plots as the page's script reads them.
    fn plots(&self) -> Value {
        let start = "<script type=\"application/json\" id=\"plots\">";
        let (_, rest) = self.html.split_once(start).unwrap();
        serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
    }

    /// The page without the plots library.
    fn without_library(&self) -> String {
        let (before, rest) = self
            .html
            .split_once("<script type=\"text/javascript\">")
            .unwrap();
        let (library, after) = rest.split_once("</script>").unwrap();
        assert!(library.contains("plotly.js v"));
        assert!(
            !after.contains("text/javascript"),
            "a second library, that sets formulas"
        );
        format!("{before}{after}")
    }
}

fn body_rows(html: &str, table: &str) -> usize {
    let (_, rest) = html.split_once(&format!("<table id=\"{table}\">")).unwrap();
    let (table, _) = rest.split_once("</table>").unwrap();
    table
        .split_once("<tbody>")
        .unwrap()
        .1
        .matches("<tr>")
        .count()
}

#[test]
fn every_configuration_and_checkpoint_is_in_the_page() {
    let made = &*MADE;
    let configurations = &made.results.configurations;
    assert_eq!(configurations.len(), 2);
    let checkpoints = configurations
        .iter()
        .map(|it| it.checkpoints.len())
        .sum::<usize>();
    let rows = configurations
        .iter()
        .flat_map(|it| &it.repeats)
        .map(|repeat| repeat.rows.len());
    assert!(checkpoints >= 2 * 6);
    assert_eq!(body_rows(&made.html, "checkpoints"), checkpoints);
    assert_eq!(body_rows(&made.html, "rows"), rows.sum::<usize>());
    for definition in &made.results.definitions {
        assert!(
            made.html.contains(&format!("<dt>{}", definition.name)),
            "{}",
            definition.name
        );
    }

    // Curves of MSE go through every mean that a logarithm has.
    let plots = made.plots();
    for (axis, abscissa) in [("time", true), ("samples", false)] {
        let traces = plots["measures"][2][axis]["data"].as_array().unwrap();
        let lines = traces
            .iter()
            .filter(|trace| trace["mode"] == "lines+markers");
        let lines: Vec<&Value> = lines.collect();
        assert_eq!(lines.len(), configurations.len());
        for (line, configuration) in lines.into_iter().zip(configurations) {
            let shown = configuration
                .checkpoints
                .iter()
                .filter(|at| at.mse.value > 0.0);
            let (x, y): (Vec<f64>, Vec<f64>) = shown
                .map(|at| {
                    let x = if abscissa {
                        at.cpu_seconds.value
                    } else {
                        at.samples
                    };
                    (x, at.mse.value)
                })
                .unzip();
            assert_eq!(line["x"], serde_json::json!(x));
            assert_eq!(line["y"], serde_json::json!(y));
        }
    }
    let stages = plots["stages"]["data"].as_array().unwrap();
    assert_eq!(stages.len(), configurations[0].stages.len());
}

#[test]
fn page_loads_nothing_and_names_do_not_run() {
    let made = &*MADE;
    let page = made.without_library();
    for fetched in ["http:", "https:", "@import", "url(", "src=\"//", "import("] {
        assert!(!page.contains(fetched), "{fetched}");
    }
    for (_, rest) in page
        .match_indices("src=\"")
        .map(|(at, _)| page.split_at(at + 5))
    {
        assert!(
            rest.starts_with("data:image/png;base64,"),
            "{}",
            &rest[..40]
        );
    }
    assert_eq!(made.results.configurations[1].name, HOSTILE);
    assert!(!page.contains("<script>alert"));
    assert!(!page.contains("<img src>"));
    assert!(page.contains("&lt;/script&gt;&lt;script&gt;alert(1)"));
    let plots = made.plots().to_string();
    assert!(
        plots.contains("&lt;/script&gt;"),
        "the library reads tags, too"
    );
    assert!(!plots.contains("<img"));
}

#[test]
#[allow(
    clippy::print_stderr,
    reason = "tells the developer that the test did nothing"
)]
fn browser_draws_curves_and_shows_values_under_the_mouse() {
    let Some(chromium) = chromium() else {
        eprintln!("skipped: no Chromium on the path, and WAVEPATH_CHROMIUM names none");
        return;
    };
    let made = &*MADE;
    let mut page = Page::open(&chromium, &made.page(), [1280, 900]);
    page.wait_until("document.body?.dataset.drawn === 'relative error'");
    for plot in ["by-time", "by-samples"] {
        let curves = format!("document.querySelectorAll('#{plot} .scatterlayer .js-line').length");
        assert!(
            page.evaluate(&curves).as_u64().unwrap() >= 2,
            "{plot} has curves"
        );
    }
    let bars = page.evaluate("document.querySelectorAll('#by-stage .barlayer .point').length");
    let stages: usize = made
        .results
        .configurations
        .iter()
        .map(|it| it.stages.len())
        .sum();
    assert_eq!(bars.as_u64(), Some(stages as u64));

    // The last point of the last curve of the samples.
    page.evaluate("document.getElementById('by-samples').scrollIntoView({ block: 'center' })");
    let place = page.evaluate(
        "(() => { const points = document.querySelectorAll('#by-samples .scatterlayer .trace:last-child .point'); \
         const box = points[points.length - 1].getBoundingClientRect(); \
         return [box.x + box.width / 2, box.y + box.height / 2]; })()",
    );
    page.point_at(place[0].as_f64().unwrap() - 3.0, place[1].as_f64().unwrap());
    page.point_at(place[0].as_f64().unwrap(), place[1].as_f64().unwrap());
    page.wait_until("document.querySelector('#by-samples .hoverlayer .hovertext') !== null");
    let told =
        page.evaluate("document.querySelector('#by-samples .hoverlayer .hovertext').textContent");
    let told = told.as_str().unwrap();
    for part in ["</script>", "samples per pixel", "CPU s", "relative error"] {
        assert!(told.contains(part), "{part} is not in {told}");
    }

    // Another measure.
    page.evaluate(
        "(() => { const measure = document.getElementById('measure'); measure.selectedIndex = 1; \
         measure.dispatchEvent(new Event('change')); })()",
    );
    page.wait_until("document.body.dataset.drawn === 'RMSE'");
    let title = page.evaluate("document.querySelector('#by-time .ytitle').textContent");
    assert_eq!(title, "RMSE");

    // A narrow window: the page itself does not scroll sideways.
    page.resize([400, 800]);
    page.wait_until("document.documentElement.scrollWidth <= 400");

    assert_eq!(page.errors(), Vec::<String>::new());
    for request in page.requests() {
        let is_inside = ["file://", "data:", "blob:"]
            .iter()
            .any(|kind| request.starts_with(kind));
        assert!(is_inside, "{request}");
    }
}
