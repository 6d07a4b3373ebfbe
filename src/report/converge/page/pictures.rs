//! Pictures after equal time with their errors, where the slowest pixels are, and where bias is.

use std::fs;
use std::path::Path;

use maud::{Markup, html};

use super::super::{BiasTest, Configuration, Picture, Results, SlowPixel};
use super::format::{number, optional, percent};
use super::swatch;
use crate::error::{Error, Result};
use crate::report::html::data_address;

/// |z| of a block that has the full colour.
const FULL_Z: f64 = 6.0;

/// Slow pixels that are listed.
const LISTED: usize = 8;

/// The references, then a column per configuration: image, signed error, where the error is.
pub(super) fn strip(results: &Results, folder: &Path) -> Result<Markup> {
    let mut columns = Vec::new();
    for reference in &results.references {
        if let Some(image) = &reference.image {
            let image = embedded(folder, image, "reference")?;
            columns.push(html! {
                figure.panel {
                    figcaption {
                        h3 { "Reference" }
                        p.small.faint {
                            "relative error " (optional(reference.relative_error, percent))
                        }
                    }
                    (image)
                }
            });
        }
    }
    for (index, configuration) in results.configurations.iter().enumerate() {
        if let Some(picture) = &configuration.picture {
            columns.push(column(results, index, configuration, picture, folder)?);
        }
    }
    Ok(html! { div.strip { @for column in columns { (column) } } })
}

fn column(
    results: &Results,
    index: usize,
    configuration: &Configuration,
    picture: &Picture,
    folder: &Path,
) -> Result<Markup> {
    let Configuration { name, slowest, .. } = configuration;
    let image = embedded(folder, &picture.image, &format!("{name}: image"))?;
    let error = embedded(
        folder,
        &picture.error_image,
        &format!("{name}: signed error"),
    )?;
    let map = embedded(folder, &picture.error_map, &format!("{name}: error"))?;
    let size = (results.scene.width, results.scene.height);
    Ok(html! {
        figure.panel {
            figcaption {
                h3 { (swatch(index)) (name) }
                p.small.faint {
                    (picture.samples) " samples per pixel, " (number(picture.cpu_seconds)) " CPU s, relative error "
                    (optional(picture.relative_error, percent))
                }
            }
            (image)
            (error)
            div.marked { (map) @for pixel in slowest { (mark(pixel, size)) } }
            @if !slowest.is_empty() {
                details {
                    summary { "slowest pixels" }
                    table {
                        thead { tr { th { "pixel" } th { "relative error" } th { "share" } } }
                        tbody {
                            @for pixel in slowest.iter().take(LISTED) {
                                tr {
                                    td { (pixel.x) ", " (pixel.y) }
                                    td { (percent(pixel.relative_error)) }
                                    td { (percent(pixel.share)) }
                                }
                            }
                        }
                    }
                }
            }
        }
    })
}

/// A PNG file of the output folder, inside the page.
fn embedded(folder: &Path, file: &str, text: &str) -> Result<Markup> {
    let path = folder.join(file);
    let bytes = fs::read(&path).map_err(|error| Error::io(&path, &error))?;
    Ok(html! { img src=(data_address("image/png", &bytes)) alt=(text) title=(text); })
}

/// A ring around a pixel of the picture that it lies over.
fn mark(pixel: &SlowPixel, (width, height): (u32, u32)) -> Markup {
    let share = |at: u32, of: u32| 100.0 * (f64::from(at) + 0.5) / f64::from(of.max(1));
    let style = format!(
        "left:{:.3}%;top:{:.3}%",
        share(pixel.x, width),
        share(pixel.y, height)
    );
    let text = format!(
        "column {}, row {}: {} of the squared error",
        pixel.x,
        pixel.y,
        percent(pixel.share)
    );
    html! { span.ring style=(style) title=(text) {} }
}

/// A picture per configuration of the mean error of each block of pixels over its standard error.
pub(super) fn bias_maps(results: &Results) -> Markup {
    let maps = results.configurations.iter().enumerate();
    let maps = maps.filter(|(_, configuration)| !configuration.bias.blocks.is_empty());
    html! {
        div.strip {
            @for (index, configuration) in maps {
                figure.panel {
                    figcaption { h3 { (swatch(index)) (configuration.name) } }
                    (bias_map(&configuration.bias, results.scene.width))
                }
            }
        }
    }
}

fn bias_map(bias: &BiasTest, width: u32) -> Markup {
    let columns = width.div_ceil(bias.block.max(1)).max(1) as usize;
    let rows = bias.blocks.len().div_ceil(columns);
    html! {
        svg viewBox=(format!("0 0 {columns} {rows}")) role="img" aria-label="z of each block of pixels" {
            @for (index, z) in bias.blocks.iter().enumerate() {
                @let side = if *z > 0.0 { "above" } else { "below" };
                rect class=(side) x=(index % columns) y=(index / columns) width="1" height="1"
                    fill-opacity=(format!("{:.2}", (z.abs() / FULL_Z).min(1.0))) {
                    title { "z = " (format!("{z:.1}")) }
                }
            }
        }
    }
}
