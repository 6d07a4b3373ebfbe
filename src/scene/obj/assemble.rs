//! Chunks put together, in order: indices of the whole file, polygons as triangles.

use glam::DVec3;

use super::lines::LineMap;
use super::parse::{Elements, KINDS, Mistake, NOUNS, Statement, StatementKind, corner_in_line};
use super::triangulate::{self, Outcome};
use crate::scene::description::Mesh;
use crate::scene::diagnostics::Finding;

/// A file's elements from all chunks so far.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    positions: Vec<DVec3>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// Indices from 0 of each kind at the corners of each triangle; empty if no corner has that kind.
    /// Those beyond what the file has are found by `forward`.
    triangles: [Vec<[u32; 3]>; KINDS],
    /// Polygons with more than three corners, as fans.
    polygons: Vec<Fan>,
    /// For each kind, corners with indices larger than any above and than what stands above: the
    /// first that does not exist in the whole file is among them.
    forward: [Vec<Forward>; KINDS],
    /// Lines of the chunks so far.
    pub(super) line_count: u32,
    pub(super) statements: Vec<Statement>,
    pub(super) face_lines: LineMap,
    pub(super) position_lines: LineMap,
    pub(super) non_finite: Finding,
    pub(super) incomplete: Finding,
}

/// A polygon's triangles: consecutive ones that share its first corner.
#[derive(Debug, Clone, Copy)]
struct Fan {
    first: u32,
    corners: u32,
}

/// An index of something that does not stand above it.
#[derive(Debug, Clone, Copy)]
struct Forward {
    index: i64,
    line: u32,
    column: u32,
}

/// What became of attributes and polygons.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Repairs {
    /// Normals without a direction, and texture coordinates that are not finite: left out.
    pub(super) bad_attributes: usize,
    /// Polygons without a triangulation, by the line of each: fans of triangles.
    pub(super) fans: Finding,
}

impl Assembly {
    /// Adds the elements of the next chunk, whose text is `text`. Errors with the place of an index
    /// that counts back too far.
    pub(super) fn add(&mut self, mut elements: Elements, text: &[u8]) -> Result<(), Mistake> {
        let above = [self.positions.len(), self.uvs.len(), self.normals.len()];
        for (kind, &above) in above.iter().enumerate() {
            for &corner in &elements.relative[kind] {
                let index = &mut elements.corners[kind][corner as usize];
                *index += above as i64;
                if *index < 1 {
                    return Err(self.missing_relative(&elements, kind, corner, text));
                }
            }
        }
        let (faces_above, lines_above) = (self.triangles[0].len() as u32, self.line_count);
        self.position_lines
            .append(&elements.position_lines, above[0] as u32, lines_above);
        self.non_finite.append(&elements.non_finite, lines_above);
        self.incomplete.append(&elements.incomplete, lines_above);
        self.positions.append(&mut elements.positions);
        self.uvs.append(&mut elements.uvs);
        self.normals.append(&mut elements.normals);

        // Triangles before each face, for the statements; most chunks have none.
        let mut statements = std::mem::take(&mut elements.statements)
            .into_iter()
            .peekable();
        let mut start = 0;
        for (number, face) in (0..).zip(&elements.faces) {
            while let Some(statement) = statements.next_if(|next| next.faces_before <= number) {
                self.add_statement(statement);
            }
            let first = self.triangles[0].len() as u32;
            let end = face.end as usize;
            let corners = (end - start) as u32;
            self.face_lines
                .push(first, corners - 2, face.line + lines_above);
            if corners > 3 {
                self.polygons.push(Fan { first, corners });
            }
            for second in start + 1..end - 1 {
                let triangle = [start, second, second + 1].map(|k| elements.corners[0][k]);
                // Indices beyond 32 bits are beyond the file, too.
                self.triangles[0].push(triangle.map(|index| (index - 1) as u32));
            }
            start = end;
        }
        statements.for_each(|statement| self.add_statement(statement));
        for kind in 1..KINDS {
            self.add_attribute(&elements, kind, faces_above as usize);
        }
        for kind in 0..KINDS {
            self.note_forward(&elements, kind, text);
        }
        self.line_count += elements.line_count;
        Ok(())
    }

    fn add_statement(&mut self, statement: Statement) {
        self.statements.push(Statement {
            line: statement.line + self.line_count,
            faces_before: self.triangles[0].len() as u32,
            ..statement
        });
    }

    /// Adds a chunk's indices of normals or texture coordinates, whose triangles begin at `above`.
    fn add_attribute(&mut self, elements: &Elements, kind: usize, above: usize) {
        let [positions, ..] = &self.triangles;
        let total = positions.len();
        let corners = &elements.corners[kind];
        let triangles = &mut self.triangles[kind];
        if !corners.is_empty() {
            triangles.resize(above, [Mesh::ABSENT; 3]);
            // A face may be above the first one that has the attribute, or below the last.
            let index = |corner: usize| match corners.get(corner) {
                None | Some(0) => Mesh::ABSENT,
                Some(&index) => (index - 1) as u32,
            };
            let mut start = 0;
            for face in &elements.faces {
                let end = face.end as usize;
                let fan = (start + 1..end - 1).map(|k| [start, k, k + 1].map(index));
                triangles.extend(fan);
                start = end;
            }
        } else if !triangles.is_empty() {
            triangles.resize(total, [Mesh::ABSENT; 3]);
        }
    }

    /// Notes where indices of a chunk exceed all others and what the file has up to the chunk's end.
    fn note_forward(&mut self, elements: &Elements, kind: usize, text: &[u8]) {
        let so_far = [self.positions.len(), self.uvs.len(), self.normals.len()][kind] as i64;
        let known = &mut self.forward[kind];
        let mut highest = known.last().map_or(so_far, |last| last.index.max(so_far));
        for (corner, &index) in elements.corners[kind].iter().enumerate() {
            if index > highest {
                highest = index;
                let (line, column, _) = place(elements, corner, text);
                known.push(Forward {
                    index,
                    line: line + self.line_count,
                    column,
                });
            }
        }
    }

    fn missing_relative(
        &self,
        elements: &Elements,
        kind: usize,
        corner: u32,
        text: &[u8],
    ) -> Mistake {
        let (line, column, word) = place(elements, corner as usize, text);
        let index = word.split('/').nth(kind).unwrap_or_default();
        Mistake {
            line: line + self.line_count,
            column,
            message: format!(
                "{} {index} does not exist; it counts back too far",
                NOUNS[kind]
            ),
        }
    }

    /// The mesh of the whole file and what was repaired in it. Errors with the place of the first index
    /// that does not exist.
    pub(super) fn finish(&mut self) -> Result<(Mesh, Repairs), Mistake> {
        let totals = [self.positions.len(), self.uvs.len(), self.normals.len()];
        for kind in 0..KINDS {
            // Many exporters write indices of an attribute that the file does not have.
            if kind > 0 && totals[kind] == 0 {
                self.triangles[kind] = Vec::new();
                continue;
            }
            let total = totals[kind] as i64;
            if let Some(missing) = self.forward[kind].iter().find(|f| f.index > total) {
                return Err(Mistake {
                    line: missing.line,
                    column: missing.column,
                    message: format!(
                        "{} {} does not exist; the file has {total}",
                        NOUNS[kind], missing.index
                    ),
                });
            }
        }
        let mut repairs = Repairs::default();
        self.triangulate(&mut repairs);
        let [mut faces, mut face_uvs, mut face_normals] = std::mem::take(&mut self.triangles);
        let is_bad_uv = |uv: &[f32; 2]| !uv.iter().all(|value| value.is_finite());
        let is_bad_normal = |normal: &[f32; 3]| !normal.iter().all(|value| value.is_finite());
        repairs.bad_attributes += leave_out(&mut self.uvs, &mut face_uvs, is_bad_uv);
        repairs.bad_attributes += leave_out(&mut self.normals, &mut face_normals, is_bad_normal);
        for list in [&mut faces, &mut face_uvs, &mut face_normals] {
            list.shrink_to_fit();
        }
        Ok((
            Mesh {
                positions: std::mem::take(&mut self.positions),
                faces,
                face_materials: Vec::new(),
                normals: std::mem::take(&mut self.normals),
                face_normals,
                uvs: std::mem::take(&mut self.uvs),
                face_uvs,
            },
            repairs,
        ))
    }

    /// Replaces the fans of polygons that are not convex.
    fn triangulate(&mut self, repairs: &mut Repairs) {
        let mut outline = Vec::new();
        for fan in &self.polygons {
            let (first, count) = (fan.first as usize, fan.corners as usize - 2);
            outline.clear();
            let corner = |index: u32| self.positions[index as usize];
            let fan_of = &self.triangles[0][first..first + count];
            outline.extend(fan_of[0][..2].iter().map(|&index| corner(index)));
            outline.extend(fan_of.iter().map(|triangle| corner(triangle[2])));
            match triangulate::polygon(&outline) {
                Outcome::Fan => {}
                Outcome::NoTriangulation => {
                    repairs.fans.add(self.face_lines.line_of(fan.first));
                }
                Outcome::Triangles(clipped) => {
                    for triangles in self.triangles.iter_mut().filter(|list| !list.is_empty()) {
                        rearrange(&mut triangles[first..first + count], &clipped);
                    }
                }
            }
        }
        self.polygons = Vec::new();
    }
}

/// Line in the chunk, column and text of a corner; column 0 and no text in a line joined from several.
fn place(elements: &Elements, corner: usize, text: &[u8]) -> (u32, u32, String) {
    let number = elements
        .faces
        .partition_point(|face| face.end as usize <= corner);
    let face = elements.faces[number];
    let start = match number {
        0 => 0,
        _ => elements.faces[number - 1].end as usize,
    };
    match corner_in_line(&text[face.offset as usize..], corner - start) {
        Some((column, word)) => {
            let word = String::from_utf8_lossy(word).into_owned();
            (face.line, column, word)
        }
        None => (face.line, 0, String::new()),
    }
}

/// The triangles of a fan with the corners that `clipped` has, which counts them along the outline.
fn rearrange(fan: &mut [[u32; 3]], clipped: &[[u32; 3]]) {
    let [first, second, _] = fan[0];
    let outline: Vec<u32> = [first, second]
        .into_iter()
        .chain(fan.iter().map(|triangle| triangle[2]))
        .collect();
    for (triangle, corners) in fan.iter_mut().zip(clipped) {
        *triangle = corners.map(|corner| outline[corner as usize]);
    }
}

/// Makes the bad ones of `values` absent from `triangles`; returns how many are bad.
fn leave_out<T: Default>(
    values: &mut [T],
    triangles: &mut [[u32; 3]],
    is_bad: impl Fn(&T) -> bool,
) -> usize {
    let bad: Vec<bool> = values.iter().map(&is_bad).collect();
    let count = bad.iter().filter(|&&bad| bad).count();
    if count > 0 {
        for index in triangles.as_flattened_mut() {
            if bad.get(*index as usize) == Some(&true) {
                *index = Mesh::ABSENT;
            }
        }
        for (value, bad) in values.iter_mut().zip(bad) {
            if bad {
                *value = T::default();
            }
        }
    }
    count
}

/// The statements of a kind.
pub(super) fn statements(
    all: &[Statement],
    kind: StatementKind,
) -> impl Iterator<Item = &Statement> {
    all.iter().filter(move |statement| statement.kind == kind)
}
