//! On which line of the file an element stands, without a number per element.

/// Lines of elements (vertices, triangles) that were added in order. Consecutive lines with equally many
/// elements each are one entry.
#[derive(Debug, Clone, Default)]
pub(super) struct LineMap {
    runs: Vec<Run>,
}

/// Consecutive lines with the same number of elements each.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// Index of the first line's first element.
    first: u32,
    /// The first line, from 1.
    line: u32,
    /// Elements per line, > 0.
    per_line: u32,
}

impl Run {
    fn line_of(&self, element: u32) -> u32 {
        self.line + (element - self.first) / self.per_line
    }
}

impl LineMap {
    /// The elements `first .. first + count` stand on `line`. Elements come in order, without gaps.
    pub(super) fn push(&mut self, first: u32, count: u32, line: u32) {
        let continues = self
            .runs
            .last()
            .is_some_and(|run| run.per_line == count && run.line_of(first) == line);
        if !continues {
            self.runs.push(Run {
                first,
                line,
                per_line: count,
            });
        }
    }

    /// Adds what `other` has, its elements and lines counted from `elements` and `lines` on.
    pub(super) fn append(&mut self, other: &Self, elements: u32, lines: u32) {
        self.runs.extend(other.runs.iter().map(|run| Run {
            first: run.first + elements,
            line: run.line + lines,
            per_line: run.per_line,
        }));
    }

    /// The line of an element that was added.
    pub(super) fn line_of(&self, element: u32) -> u32 {
        let after = self.runs.partition_point(|run| run.first <= element);
        self.runs[after - 1].line_of(element)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_is_found_on_its_line() {
        let lines = [
            (1, 3),
            (1, 4),
            (1, 5),
            (2, 6),
            (2, 7),
            (1, 8),
            (1, 12),
            (3, 13),
        ];
        let mut map = LineMap::default();
        let mut expected = Vec::new();
        for (count, line) in lines {
            map.push(expected.len() as u32, count, line);
            expected.extend(vec![line; count as usize]);
        }
        assert_eq!(map.runs.len(), 5, "equal lines share a run");
        let mut twice = map.clone();
        twice.append(&map, expected.len() as u32, 100);
        expected.extend(expected.clone().iter().map(|line| line + 100));
        for (element, &line) in (0..).zip(&expected) {
            assert_eq!(twice.line_of(element), line);
        }
    }
}
