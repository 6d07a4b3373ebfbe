//! What is wrong with a file though it can be used: counts, and the first few places.

use std::fmt;

/// Places that are told of each kind of finding.
pub(super) const MAX_PLACES: usize = 5;

/// How often something was found, and on which lines first.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Finding {
    /// How often.
    pub(super) count: usize,
    /// The first few lines, from 1.
    lines: Vec<u32>,
}

impl Finding {
    /// Found on `line`.
    pub(super) fn add(&mut self, line: u32) {
        self.count += 1;
        if self.lines.len() < MAX_PLACES && self.lines.last() != Some(&line) {
            self.lines.push(line);
        }
    }

    /// Found `count` times, first on these lines.
    pub(super) fn new(count: usize, lines: impl IntoIterator<Item = u32>) -> Self {
        let mut finding = Self::default();
        lines.into_iter().for_each(|line| finding.add(line));
        finding.count = count;
        finding
    }

    /// Adds what was found further down, its lines counted from `offset` on.
    pub(super) fn append(&mut self, other: &Self, offset: u32) {
        let room = MAX_PLACES.saturating_sub(self.lines.len());
        let lines = other.lines.iter().take(room);
        self.lines.extend(lines.map(|line| line + offset));
        self.count += other.count;
    }

    /// One sentence: the count, `noun` with an s for many, `what` happened to them, and the places.
    /// `None` if nothing was found.
    pub(super) fn sentence(&self, noun: &str, what: &str) -> Option<String> {
        let Self { count, .. } = self;
        match count {
            0 => None,
            1 => Some(format!("1 {noun} {what}{self}")),
            _ => Some(format!("{count} {} {what}{self}", plural(noun))),
        }
    }
}

/// ` (lines 3, 5, …)`, or nothing where no line is known.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<String> = self.lines.iter().map(u32::to_string).collect();
        let more = if self.count > lines.len() {
            ", …"
        } else {
            ""
        };
        match lines.as_slice() {
            [] => Ok(()),
            [line] => write!(f, " (line {line}{more})"),
            _ => write!(f, " (lines {}{more})", lines.join(", ")),
        }
    }
}

fn plural(noun: &str) -> String {
    match noun.strip_suffix("ex") {
        Some(stem) => format!("{stem}ices"),
        None => format!("{noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_count_and_name_the_first_lines() {
        let mut finding = Finding::default();
        assert_eq!(finding.sentence("vertex", "not finite"), None);
        finding.add(4);
        let text = finding.sentence("vertex", "not finite").unwrap();
        assert_eq!(text, "1 vertex not finite (line 4)");
        let mut further = Finding::default();
        (1..=9).for_each(|line| further.add(line));
        finding.append(&further, 10);
        assert_eq!(
            finding.sentence("vertex", "not finite").unwrap(),
            "10 vertices not finite (lines 4, 11, 12, 13, 14, …)"
        );
        let unknown = Finding::new(2, []);
        assert_eq!(
            unknown.sentence("face", "removed").unwrap(),
            "2 faces removed"
        );
    }
}
