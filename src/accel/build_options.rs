//! How much work a hierarchy's build may take, and what it tells while it runs.

/// How much time a build spends for a tree that is traversed faster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BuildQuality {
    /// Shortest build.
    Fast,
    /// About the build time of a binned surface-area builder.
    #[default]
    Medium,
    /// Several times longer; triangles may be cut and be in several leaves.
    Best,
}

/// Part of a build.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BuildPhase {
    /// Boxes of all primitives, sorted.
    Sort,
    /// Clusters are merged into a binary tree, or everything is split into one.
    Cluster,
    /// Subtrees are moved to better places.
    Optimize,
    /// The binary tree becomes the final one.
    Collapse,
}

/// Settings of a build.
#[derive(Clone, Copy, Default)]
pub struct BuildOptions<'a> {
    /// Time against quality.
    pub quality: BuildQuality,
    /// Called from the building thread with the phase and the share of it that is done, in [0, 1].
    pub progress: Option<&'a dyn Fn(BuildPhase, f64)>,
}

impl std::fmt::Debug for BuildOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BuildOptions")
            .field("quality", &self.quality)
            .field("progress", &self.progress.is_some())
            .finish()
    }
}

impl BuildOptions<'_> {
    pub(super) fn report(&self, phase: BuildPhase, share: f64) {
        if let Some(progress) = self.progress {
            progress(phase, share);
        }
    }
}

/// What a quality means to the steps of the build.
#[derive(Debug, Clone, Copy)]
pub(super) struct Preset {
    /// Neighbours on each side among which a cluster looks for its partner. `None`: nothing is clustered; the
    /// tree is built from the top, and triangles may be in several leaves.
    pub(super) window: Option<usize>,
    /// Nodes that the first reinsertion pass looks at, as a share of all.
    pub(super) reinsertion: f32,
}

impl BuildQuality {
    pub(super) fn preset(self) -> Preset {
        match self {
            Self::Fast => Preset {
                window: Some(4),
                reinsertion: 0.01,
            },
            Self::Medium => Preset {
                window: Some(8),
                reinsertion: 0.02,
            },
            Self::Best => Preset {
                window: None,
                reinsertion: 0.2,
            },
        }
    }
}
