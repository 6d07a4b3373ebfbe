//! A page of pictures, each with how it was made, what it took, and the command that repeats it.

use maud::{Markup, html};

use super::html::{data_address, document, machine_line};
use super::{RenderReport, summary};

/// Pictures that are to be compared with one another.
#[derive(Debug, Clone)]
pub struct GallerySection {
    /// Heading.
    pub title: String,
    /// What to look for, a sentence or two.
    pub text: String,
    /// The pictures, in order.
    pub figures: Vec<GalleryFigure>,
}

/// A picture and what there is to say about it.
#[derive(Debug, Clone)]
pub struct GalleryFigure {
    /// Heading.
    pub title: String,
    /// What it shows.
    pub text: String,
    /// The picture's file, beside the page.
    pub file: String,
    /// What that file holds, a PNG image.
    pub png: Vec<u8>,
    /// The words of the command line that repeats it, quoted for a shell.
    pub command: Vec<String>,
    /// The report of the render.
    pub report: RenderReport,
}

/// The page, pictures inside. Its links lead to the files beside it.
pub fn gallery_page(title: &str, text: &str, sections: &[GallerySection]) -> String {
    let first = sections.iter().flat_map(|section| &section.figures).next();
    let body = html! {
        header {
            h1 { (title) }
            p { (text) }
            @if let Some(figure) = first {
                p.faint.small { (machine_line(&figure.report.machine)) }
            }
        }
        @for section in sections {
            section {
                h2 { (section.title) }
                p { (section.text) }
                div.figures { @for figure in &section.figures { (card(figure)) } }
            }
        }
        section {
            h2 { "The figures below each picture" }
            p {
                "CPU time is that of all threads while they render; loading, building and writing are "
                "outside. The estimated error is the root of the mean, over pixels and channels, of variance / "
                "(mean² + ε²), with the variance of each pixel from the spread of its sample blocks, or from its two "
                "independent halves, and ε 1 % of the image's mean. It needs two samples, and tells of noise alone, not of bias."
            }
        }
    };
    document(title, include_str!("gallery.css"), &body)
}

fn card(figure: &GalleryFigure) -> Markup {
    let GalleryFigure {
        title,
        text,
        file,
        png,
        command,
        report,
    } = figure;
    let (scene, rays) = (&report.scene, &report.rays);
    html! {
        figure.panel {
            a href=(file) {
                img src=(data_address("image/png", png)) width=(scene.width) height=(scene.height) alt=(title);
            }
            figcaption {
                h3 { (title) }
                p { (text) }
                dl {
                    dt { "size" } dd { (scene.width) " × " (scene.height) }
                    dt { "samples" } dd { (report.result.samples_per_pixel()) " per pixel" }
                    dt { "method" } dd { (method(report)) }
                    dt { "CPU time" } dd { (seconds(report.times.render.cpu_seconds)) }
                    dt { "rays" } dd {
                        (format!("{:.1}", 1e-6 * rays.total as f64)) " million, "
                        (format!("{:.1}", 1e-6 * rays.per_cpu_second)) " million per CPU s"
                    }
                    dt { "error" } dd { (error(report.result.relative_error)) }
                    @for bias in &report.result.bias { dt { "biased" } dd.warn { (bias) } }
                }
                // Lines break between words alone, never after the dashes of an option.
                pre { code { @for word in command { span { (word) } " " } } }
            }
        }
    }
}

/// Integrator, and what else decides the estimate.
fn method(report: &RenderReport) -> String {
    use crate::scene::IntegratorKind;
    let settings = &report.settings;
    let integrator = summary::name(settings.integrator);
    match settings.integrator {
        IntegratorKind::Whitted => integrator,
        IntegratorKind::Path | IntegratorKind::Reference => format!(
            "{integrator}, {}, {} samples",
            summary::name(settings.strategy),
            summary::name(settings.sampler)
        ),
    }
}

/// Seconds with three digits or so.
fn seconds(seconds: f64) -> String {
    match seconds {
        10.0.. => format!("{seconds:.1} s"),
        1.0.. => format!("{seconds:.2} s"),
        _ => format!("{seconds:.3} s"),
    }
}

fn error(relative: Option<f64>) -> String {
    relative.map_or("no estimate".to_owned(), |error| {
        format!("{:.2} % estimated", 100.0 * error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(title: &str, png: &[u8]) -> GalleryFigure {
        GalleryFigure {
            title: title.to_owned(),
            text: "What it shows.".to_owned(),
            file: "a b.png".to_owned(),
            png: png.to_owned(),
            command: ["wavepath", "render", "--set", "'a=<b>'"]
                .map(str::to_owned)
                .to_vec(),
            report: super::super::tests::sample(),
        }
    }

    #[test]
    fn every_figure_is_there_with_its_time_error_and_command() {
        let section = GallerySection {
            title: "Pairs & <more>".to_owned(),
            text: "Look.".to_owned(),
            figures: vec![figure("First", b"one"), figure("<Second>", b"two")],
        };
        let page = gallery_page("Pictures", "All of them.", &[section]);
        for part in [
            "<h1>Pictures</h1>",
            "Pairs &amp; &lt;more&gt;",
            "<h3>First</h3>",
            "<h3>&lt;Second&gt;</h3>",
            "data:image/png;base64,b25l",
            "data:image/png;base64,dHdv",
            "href=\"a b.png\"",
            "2 × 1",
            "6 per pixel",
            "path, mis, sobol samples",
            "0.000 s",
            "% estimated",
            "depth limit 16: 3 paths cut",
            "<span>--set</span> <span>'a=&lt;b&gt;'</span>",
        ] {
            assert!(page.contains(part), "{part} is missing in\n{page}");
        }
    }

    #[test]
    fn numbers_keep_three_digits_or_say_that_there_is_none() {
        assert_eq!(seconds(0.0123), "0.012 s");
        assert_eq!(seconds(1.234), "1.23 s");
        assert_eq!(seconds(123.456), "123.5 s");
        assert_eq!(error(Some(0.0312)), "3.12 % estimated");
        assert_eq!(error(None), "no estimate");
    }
}
