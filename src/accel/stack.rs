//! What a traversal remembers for later.

/// A child of a node, and where the ray enters its box.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Entry {
    pub(super) t: f32,
    /// Index of a node, or of a leaf with the top bit set.
    child: u32,
}

const LEAF: u32 = 1 << 31;

impl Entry {
    /// The inner node at `index`.
    pub(super) fn node(index: u32) -> Self {
        Self {
            t: 0.0,
            child: index,
        }
    }

    /// The leaf at `index`.
    pub(super) fn leaf(index: u32) -> Self {
        Self {
            t: 0.0,
            child: index | LEAF,
        }
    }

    /// The same child, entered at `t`.
    #[inline(always)]
    pub(super) fn entered_at(self, t: f32) -> Self {
        Self { t, ..self }
    }

    /// The leaf's index, if it is a leaf.
    #[inline(always)]
    pub(super) fn as_leaf(self) -> Option<u32> {
        (self.child & LEAF != 0).then_some(self.child & !LEAF)
    }

    /// The inner node's index.
    #[inline(always)]
    pub(super) fn index(self) -> usize {
        self.child as usize
    }
}

/// Trees of ordinary scenes need no more than this.
const ON_THE_STACK: usize = 256;

/// Runs `work` with room for `bound` entries; deeper trees than [`ON_THE_STACK`] cost an allocation per batch.
pub(super) fn with_stack<R>(bound: usize, work: impl FnOnce(&mut [Entry]) -> R) -> R {
    if bound <= ON_THE_STACK {
        work(&mut [Entry::default(); ON_THE_STACK])
    } else {
        work(&mut vec![Entry::default(); bound])
    }
}
