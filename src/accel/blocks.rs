//! How the 8-wide tree lies in memory: nodes of five cache lines, and leaves of as many words as their
//! primitives need, each node followed by its leaves.

use rayon::prelude::*;
use wide::{f32x8, f32x16};

use super::collapse::{WIDTH, WideChild, WideNode, WideTree};
use super::huge_pages;
use crate::error::{Error, Result};
use crate::geometry::slab::Bounds;
use crate::geometry::{Geometry, Sphere, Triangle};
use crate::math::lanes::{F32s, Mask, U32s, load_first};

/// Bit of a reference that says leaf. The other bits are a place in units of [`UNIT`] words.
pub(super) const LEAF: u32 = 1;

/// Units that references can name.
const MOST_UNITS: usize = 1 << 31;

/// This times a reference is where a node begins, in bytes, or as many bytes after where a leaf does: the machine's
/// addressing does that.
const BYTES: usize = UNIT * size_of::<f32>() / 2;

/// The reference that ends a traversal: no leaf lies at the very beginning.
pub(super) const DONE: u32 = LEAF;

/// Words of 4 bytes in a unit.
const UNIT: usize = 4;
/// Words in a cache line.
const LINE: usize = 16;
/// Cache lines of a node.
const NODE_LINES: usize = size_of::<Node>() / size_of::<f32x16>();

/// Words per triangle and per sphere of a leaf, with the id.
const TRIANGLE_WORDS: usize = 1 + 9;
const SPHERE_WORDS: usize = 1 + 4;

/// Most triangles and spheres of a leaf. Eight lanes test a leaf even where vectors have sixteen: most leaves have no
/// more triangles, and vectors of sixteen have two units to compute in where those of eight have three.
pub(super) const LEAF_SIZE: usize = 8;

/// Up to eight children with their boxes.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// Per axis the lower planes of the children, the upper ones and the lower ones again: near planes and far ones
    /// follow each other in both directions. Unused slots have empty boxes.
    pub(super) planes: [[f32x8; 3]; 3],
    /// References of the children.
    pub(super) children: [u32; WIDTH],
}

/// A leaf: ids of its triangles, their corners axis by axis and corner by corner; then ids, centres
/// and radii of its spheres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf<'a> {
    /// Number of triangles, at most [`LEAF_SIZE`].
    pub(super) triangles: usize,
    /// Number of spheres, at most [`LEAF_SIZE`].
    pub(super) spheres: usize,
    words: &'a [f32],
}

/// Nodes and leaves.
#[derive(Debug)]
pub(super) struct Blocks {
    lines: Vec<f32x16>,
    /// Reference of the root; [`DONE`] without primitives.
    pub(super) root: u32,
    /// Longest side of the box around all.
    pub(super) size: f32,
    /// Largest size of a coordinate.
    pub(super) farthest: f32,
    /// Primitives in leaves.
    pub(super) primitives: usize,
    /// Most entries that a traversal puts aside.
    pub(super) stack_bound: usize,
    /// Whether some leaf has spheres.
    pub(super) has_spheres: bool,
}

impl Blocks {
    /// Lays a tree out.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Limit`] if it takes 32 GiB or more.
    pub(super) fn new(geometry: &Geometry, tree: &WideTree) -> Result<Self> {
        let writer = Writer { geometry, tree };
        let Some((bounds, root)) = tree.root else {
            return Ok(Self {
                lines: Vec::new(),
                root: DONE,
                size: 0.0,
                farthest: 0.0,
                primitives: 0,
                stack_bound: WIDTH,
                has_spheres: false,
            });
        };
        // A leaf as the root is written as the only child of an unused node before it.
        let lone = matches!(root, WideChild::Leaf { .. }).then(|| WideNode::of_one(root));
        let nodes = lone.as_ref().map_or(&*tree.nodes, std::slice::from_ref);
        let mut starts = Vec::with_capacity(nodes.len());
        let mut total = 0;
        for node in nodes {
            starts.push(total);
            total += writer.lines(node);
        }
        if total * LINE / UNIT >= MOST_UNITS {
            return Err(Error::limit("the tree takes more than 32 GiB"));
        }
        // Whole vectors may be read at the last word.
        let mut lines: Vec<f32x16> = huge_pages::zeroed(total + 1);
        let mut rest = &mut *lines;
        let mut regions = Vec::with_capacity(nodes.len());
        for index in 0..nodes.len() {
            let end = starts.get(index + 1).map_or(total, |&next| next);
            let (region, others) = rest.split_at_mut(end - starts[index]);
            regions.push(region);
            rest = others;
        }
        regions
            .into_par_iter()
            .zip(nodes)
            .enumerate()
            .with_min_len(64)
            .for_each(|(index, (region, node))| writer.write(node, starts[index], &starts, region));
        let root = match lone {
            Some(_) => bytemuck::cast_slice::<f32x16, u32>(&lines)[NODE_LINES * LINE - WIDTH],
            None => 0,
        };
        Ok(Self {
            lines,
            root,
            size: bounds.longest_side(),
            farthest: bounds
                .corners
                .as_flattened()
                .iter()
                .fold(0.0, |most, x| f32::max(most, x.abs())),
            primitives: tree.order.len(),
            // Each level leaves at most all but one of its children behind.
            stack_bound: tree.depth * (WIDTH - 1) + 1,
            has_spheres: !geometry.spheres.is_empty(),
        })
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        std::mem::size_of_val(&*self.lines)
    }

    /// The node of a reference without [`LEAF`].
    #[inline(always)]
    pub(super) fn node(&self, reference: u32) -> &Node {
        let first = first_word(reference) / LINE;
        let lines: &[f32x16; NODE_LINES] = self.lines[first..first + NODE_LINES]
            .try_into()
            .expect("a slice of this length");
        // Of the same alignment, so that nothing is left to check.
        bytemuck::cast_ref(lines)
    }

    /// The leaf of a reference with [`LEAF`], which must not be [`DONE`].
    #[inline(always)]
    pub(super) fn leaf(&self, reference: u32) -> Leaf<'_> {
        let words: &[f32] = bytemuck::cast_slice(&self.lines);
        let words = &words[first_word(reference)..];
        let leaf = Leaf::new(&words[0], &words[1..]);
        assert!(TRIANGLE_WORDS * leaf.triangles + LEAF_SIZE <= leaf.words.len());
        leaf
    }

    /// All words, for the loops of a traversal.
    #[inline(always)]
    pub(super) fn words(&self) -> Words<'_> {
        Words(bytemuck::cast_slice(&self.lines))
    }
}

/// The words of a tree. Loops hold them: their place would be read again after whatever is written in between.
#[derive(Debug, Clone, Copy)]
pub(super) struct Words<'a>(&'a [f32]);

impl<'a> Words<'a> {
    /// As [`Blocks::node`], unchecked.
    ///
    /// # Safety
    /// `reference` is the root or a child of some node, and no leaf.
    #[expect(unsafe_code, reason = "checks of every visit cost a twentieth")]
    #[inline(always)]
    pub(super) unsafe fn node(self, reference: u32) -> &'a Node {
        debug_assert!(first_word(reference) + NODE_LINES * LINE <= self.0.len());
        // SAFETY: nodes lie within the words at whole lines, and a node is as many lines of the same alignment.
        unsafe {
            &*self
                .0
                .as_ptr()
                .byte_add(reference as usize * BYTES)
                .cast::<Node>()
        }
    }

    /// As [`Blocks::leaf`], unchecked.
    ///
    /// # Safety
    /// `reference` is the root or a child of some node, and a leaf.
    #[expect(unsafe_code, reason = "checks of every visit cost a twentieth")]
    #[inline(always)]
    pub(super) unsafe fn leaf(self, reference: u32) -> Leaf<'a> {
        let first = first_word(reference);
        debug_assert!(first < self.0.len());
        // SAFETY: leaves lie within the words, and a line follows the last.
        unsafe {
            let header = self.0.as_ptr().byte_add(reference as usize * BYTES);
            let header = header.byte_sub(LEAF as usize * BYTES);
            let rest = self.0.len() - first - 1;
            Leaf::new(&*header, std::slice::from_raw_parts(header.add(1), rest))
        }
    }

    /// Asks for the first five cache lines of what is referred to.
    #[inline(always)]
    pub(super) fn prefetch(self, reference: u32) {
        for line in 0..NODE_LINES {
            let first = reference as usize * BYTES / size_of::<f32>();
            crate::math::prefetch(self.0, first + line * LINE);
        }
    }
}

/// The reference of a node that begins at a word.
fn reference_to(word: usize) -> u32 {
    (2 * word / UNIT) as u32
}

/// Where the words of what is referred to begin.
#[inline(always)]
fn first_word(reference: u32) -> usize {
    (reference / 2) as usize * UNIT
}

impl<'a> Leaf<'a> {
    /// From its first word, of which the first byte counts triangles and the next spheres, and the words after
    /// it, which end no earlier than a vector of [`LEAF_SIZE`] words after the triangles does.
    #[inline(always)]
    fn new(header: &f32, words: &'a [f32]) -> Self {
        // A read for each count, not one of which both are made.
        let [triangles, spheres, ..]: &[u8; 4] = bytemuck::cast_ref(header);
        Self {
            triangles: usize::from(*triangles),
            spheres: usize::from(*spheres),
            words,
        }
    }

    /// Row `first + more` of the triangles, anything in lanes without one. The ids are row 0.
    ///
    /// # Safety
    /// There are [`TRIANGLE_WORDS`] rows.
    #[expect(
        unsafe_code,
        reason = "checks of nine rows take as long as their reading"
    )]
    #[inline(always)]
    pub(super) unsafe fn row_at(&self, first: usize, more: usize) -> f32x8 {
        debug_assert!(first + more < TRIANGLE_WORDS);
        // SAFETY: a vector after the last row is within `words`, and so is one within a row.
        unsafe {
            let row = self.words.as_ptr().add(first * self.triangles);
            row.add(more * self.triangles)
                .cast::<f32x8>()
                .read_unaligned()
        }
    }

    /// The row of the first corner's coordinate along an axis; those of the other corners follow it.
    pub(super) const fn first_row(axis: usize) -> usize {
        1 + 3 * axis
    }

    /// A coordinate of the triangles' corners; anything in lanes without a triangle.
    #[expect(
        unsafe_code,
        reason = "checks of nine rows take as long as their reading"
    )]
    #[inline(always)]
    pub(super) fn row(&self, axis: usize, corner: usize) -> f32x8 {
        assert!(axis < 3 && corner < 3);
        // SAFETY: so many rows there are.
        unsafe { self.row_at(Self::first_row(axis), corner) }
    }

    /// Which lanes have a triangle.
    #[inline(always)]
    pub(super) fn valid(&self) -> Mask {
        Mask(((1u32 << (self.triangles as u32 & 31)) - 1) as u16)
    }

    /// Ids of the triangles.
    #[expect(
        unsafe_code,
        reason = "checks of nine rows take as long as their reading"
    )]
    #[inline(always)]
    pub(super) fn ids(&self) -> [u32; LEAF_SIZE] {
        // SAFETY: the first row there is.
        bytemuck::cast(unsafe { self.row_at(0, 0) })
    }

    /// Id of one triangle.
    #[inline(always)]
    pub(super) fn id(&self, index: usize) -> u32 {
        self.words[index].to_bits()
    }

    /// A coordinate of one triangle's corners.
    #[inline(always)]
    pub(super) fn corners(&self, axis: usize, index: usize) -> [f32; 3] {
        [0, 1, 2].map(|corner| self.words[(1 + 3 * axis + corner) * self.triangles + index])
    }

    /// Centres and radii of the spheres, their ids, and the lanes that have one.
    #[inline(always)]
    pub(super) fn spheres(&self) -> ([F32s; 4], U32s, Mask) {
        let valid = Mask::first(self.spheres);
        let row = |row: usize| {
            let at = TRIANGLE_WORDS * self.triangles + row * self.spheres;
            load_first(self.words, at, valid)
        };
        ([1, 2, 3, 4].map(row), bytemuck::cast(row(0)), valid)
    }

    /// Id, centre and radius of one sphere.
    #[inline(always)]
    pub(super) fn sphere(&self, index: usize) -> (u32, [f32; 3], f32) {
        let words = &self.words[TRIANGLE_WORDS * self.triangles..];
        let word = |row: usize| words[row * self.spheres + index];
        (word(0).to_bits(), [word(1), word(2), word(3)], word(4))
    }
}

/// Writes nodes.
struct Writer<'a> {
    geometry: &'a Geometry,
    tree: &'a WideTree,
}

impl Writer<'_> {
    /// Ids of the primitives of a leaf.
    fn run(&self, first: u32, count: u32) -> &[u32] {
        &self.tree.order[first as usize..(first + count) as usize]
    }

    /// How many of the primitives are spheres.
    fn spheres(&self, run: &[u32]) -> usize {
        if self.geometry.spheres.is_empty() {
            return 0;
        }
        let triangles = self.geometry.triangles.len();
        run.iter().filter(|&&id| id as usize >= triangles).count()
    }

    /// Words of a leaf, in whole units.
    fn leaf_words(&self, run: &[u32]) -> usize {
        let spheres = self.spheres(run);
        let words = 1 + (run.len() - spheres) * TRIANGLE_WORDS + spheres * SPHERE_WORDS;
        words.next_multiple_of(UNIT)
    }

    /// Cache lines of a node and its leaves.
    fn lines(&self, node: &WideNode) -> usize {
        let leaves: usize = node
            .iter()
            .map(|(_, child)| match *child {
                WideChild::Leaf { first, count } => self.leaf_words(self.run(first, count)),
                WideChild::Node(_) => 0,
            })
            .sum();
        NODE_LINES + leaves.div_ceil(LINE)
    }

    /// Writes a node that begins at line `start`, and its leaves.
    fn write(&self, node: &WideNode, start: usize, starts: &[usize], region: &mut [f32x16]) {
        let (head, leaves) = region.split_at_mut(NODE_LINES);
        let leaves: &mut [u32] = bytemuck::cast_slice_mut(leaves);
        let mut used = 0;
        let mut planes = [[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]].map(|side| [side; 3]);
        let mut children = [DONE; WIDTH];
        let slots = assign_slots(node);
        for ((bounds, child), slot) in node.iter().zip(slots) {
            for (side, axes) in planes.iter_mut().enumerate() {
                for (axis, column) in axes.iter_mut().enumerate() {
                    column[slot] = bounds.corners[side][axis];
                }
            }
            children[slot] = match *child {
                WideChild::Node(index) => reference_to(starts[index as usize] * LINE),
                WideChild::Leaf { first, count } => {
                    let at = (start + NODE_LINES) * LINE + used;
                    let run = self.run(first, count);
                    let words = self.leaf_words(run);
                    self.write_leaf(run, &mut leaves[used..used + words]);
                    used += words;
                    reference_to(at) | LEAF
                }
            };
        }
        let node = Node {
            planes: [0, 1, 2].map(|axis| [0, 1, 0].map(|side| f32x8::from(planes[side][axis]))),
            children,
        };
        head.copy_from_slice(&bytemuck::cast::<Node, [f32x16; NODE_LINES]>(node));
    }

    /// Writes the primitives of a leaf, each into its place of every row.
    fn write_leaf(&self, run: &[u32], words: &mut [u32]) {
        let triangle_ids = self.geometry.triangles.len();
        let spheres = self.spheres(run);
        let triangles = run.len() - spheres;
        words[0] = (triangles | spheres << 8) as u32;
        let (triangle_rows, sphere_rows) = words[1..].split_at_mut(TRIANGLE_WORDS * triangles);
        let (mut triangle, mut sphere) = (0, 0);
        for &id in run {
            let id_at = id as usize;
            if id_at < triangle_ids {
                let Triangle { corners } = &self.geometry.triangles[id_at];
                triangle_rows[triangle] = id;
                for axis in 0..3 {
                    for corner in 0..3 {
                        triangle_rows[(1 + 3 * axis + corner) * triangles + triangle] =
                            corners[corner][axis].to_bits();
                    }
                }
                triangle += 1;
            } else {
                let Sphere { center, radius } = self.geometry.spheres[id_at - triangle_ids];
                sphere_rows[sphere] = id;
                let [x, y, z] = center;
                for (row, value) in (1..).zip([x, y, z, radius]) {
                    sphere_rows[row * spheres + sphere] = value.to_bits();
                }
                sphere += 1;
            }
        }
    }
}

/// A slot for each child, such that bit k of the slot says on which side of the node it lies along axis k,
/// as well as eight slots allow: the pair of child and slot that fits best is fixed first (the greedy form
/// of the assignment in Ylitie, Karras and Laine 2017, section 3.2).
fn assign_slots(node: &WideNode) -> [usize; WIDTH] {
    let middle = |b: &Bounds| [0, 1, 2].map(|k| 0.5 * b.corners[0][k] + 0.5 * b.corners[1][k]);
    let union = node
        .iter()
        .fold(Bounds::EMPTY, |all, (bounds, _)| all.union(bounds));
    let center = middle(&union);
    let mut fits = [[0.0; WIDTH]; WIDTH];
    for (fits, (bounds, _)) in fits.iter_mut().zip(node.iter()) {
        let middle = middle(bounds);
        for (slot, fit) in fits.iter_mut().enumerate() {
            let along = |k: usize| {
                let offset = middle[k] - center[k];
                if slot >> k & 1 == 0 { -offset } else { offset }
            };
            let sum: f32 = along(0) + along(1) + along(2);
            // Sums beyond f32 speak for no slot.
            *fit = if sum.is_finite() { sum } else { 0.0 };
        }
    }
    let mut rows = fits.map(f32x8::from);
    let mut slots = [WIDTH; WIDTH];
    // Rows of children that have a slot and columns of slots that are taken fit least.
    const LEAST: f32x8 = f32x8::splat(f32::NEG_INFINITY);
    rows[node.iter().count()..].fill(LEAST);
    for _ in node.iter() {
        let best = rows.iter().fold(LEAST, |best, row| best.max(*row));
        let best = f32x8::splat(
            best.to_array()
                .into_iter()
                .fold(f32::NEG_INFINITY, f32::max),
        );
        let equal = |row: &f32x8| row.simd_eq(best).to_bitmask();
        let child = rows.iter().position(|row| equal(row) != 0);
        let child = child.expect("the best is somewhere");
        let slot = equal(&rows[child]).trailing_zeros() as usize;
        slots[child] = slot;
        rows[child] = LEAST;
        let mut limits = [f32::INFINITY; WIDTH];
        limits[slot] = f32::NEG_INFINITY;
        rows = rows.map(|row| row.min(f32x8::from(limits)));
    }
    slots
}
