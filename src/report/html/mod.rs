//! Pages that open from disk: one file with everything inside, nothing fetched from anywhere.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde::Serialize;

use super::{Build, Machine};

/// Colours, type and tables of every page, light and dark.
const STYLE: &str = include_str!("style.css");

/// A complete page: `title`, then what `body` has, then a line about the program. `style` is added to
/// what all pages have, and is trusted, as `body` is: text from outside was escaped when it was made.
pub(super) fn document(title: &str, style: &str, body: &Markup) -> String {
    let build = Build::current();
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                // An empty icon: otherwise some browsers look for one beside the page.
                link rel="icon" href="data:,";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body {
                main { (body) }
                footer { "wavepath " (build.version) " (" (build.commit) ")" }
            }
        }
    };
    page.into_string()
}

/// The address of `bytes` themselves, for use in `src`.
pub(super) fn data_address(media_type: &str, bytes: &[u8]) -> String {
    format!("data:{media_type};base64,{}", STANDARD.encode(bytes))
}

/// A script element that holds `data` as JSON and runs nothing.
pub(super) fn json_element(id: &str, data: &impl Serialize) -> Markup {
    let json = serde_json::to_string(data).expect("plain data with string keys always serialises");
    // No text within can end the element.
    let json = json.replace('<', "\\u003c");
    html! { script type="application/json" id=(id) { (PreEscaped(json)) } }
}

/// One line about the machine on which something was measured.
pub(super) fn machine_line(machine: &Machine) -> String {
    let Machine {
        cpu,
        cores,
        os,
        load_average,
    } = machine;
    let load = load_average.map_or_else(String::new, |[one, five, fifteen]| {
        format!(", load before {one:.2} {five:.2} {fifteen:.2}")
    });
    format!("{cpu}, {cores} cores, {os}{load}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped_and_nothing_is_fetched() {
        let name = "<script>alert(1)</script>\"'&";
        let page = document(
            name,
            "p { margin: 0 }",
            &html! { p title=(name) { (name) } },
        );
        assert!(!page.contains("<script>"), "{page}");
        assert!(page.contains("&lt;script&gt;"), "{page}");
        assert!(page.contains("p { margin: 0 }"), "{page}");
        for fetched in ["http:", "https:", "@import", "url("] {
            assert!(!page.contains(fetched), "{fetched}");
        }
    }

    #[test]
    fn data_cannot_end_its_element_and_reads_back() {
        let data = ["</script><script>alert(1)</script>", "a < b & c"];
        let element = json_element("data", &data).into_string();
        assert_eq!(element.matches("</script>").count(), 1, "{element}");
        let start = element.find('>').unwrap() + 1;
        let json = &element[start..element.len() - "</script>".len()];
        let read: Vec<String> = serde_json::from_str(json).unwrap();
        assert_eq!(read, data);
    }

    #[test]
    fn picture_becomes_its_own_address() {
        assert_eq!(
            data_address("image/png", b"\x89PNG"),
            "data:image/png;base64,iVBORw=="
        );
    }
}
