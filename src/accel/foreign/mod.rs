//! Structures of other projects behind the same trait, to compare with. They lose rays at edges and
//! know neither spheres nor [`super::RayBatch::skip`] and [`super::ShadowBatch::target`], so that no
//! picture is made with them: [`super::Structure`] does not contain them.

#[cfg(feature = "embree")]
pub mod embree;
mod obvhs;
#[cfg(test)]
mod tests;

pub use self::obvhs::{ObvhsBvh2, ObvhsCwBvh};

/// How Embree builds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EmbreeBuild {
    /// Quality medium, its default.
    Medium,
    /// Quality high: with spatial splits.
    High,
    /// With the flag for robust traversal and triangle tests; then quality high builds as medium does.
    Robust,
}

/// By which calls Embree is queried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EmbreeCalls {
    /// `rtcIntersect1` and `rtcOccluded1`.
    Single,
    /// Those for packets: 16 rays where the library has AVX-512, else 8.
    Packet,
    /// Packets that are announced as coherent.
    Coherent,
}

/// Every build with every kind of calls.
pub const EMBREE: [(EmbreeBuild, EmbreeCalls); 9] = {
    use EmbreeBuild::{High, Medium, Robust};
    use EmbreeCalls::{Coherent, Packet, Single};
    [
        (Medium, Single),
        (Medium, Packet),
        (Medium, Coherent),
        (High, Single),
        (High, Packet),
        (High, Coherent),
        (Robust, Single),
        (Robust, Packet),
        (Robust, Coherent),
    ]
};

/// Name as on the command line.
pub fn embree_name(build: EmbreeBuild, calls: EmbreeCalls) -> &'static str {
    use EmbreeBuild::{High, Medium, Robust};
    use EmbreeCalls::{Coherent, Packet, Single};
    match (build, calls) {
        (Medium, Single) => "embree-medium",
        (Medium, Packet) => "embree-medium-packet",
        (Medium, Coherent) => "embree-medium-coherent",
        (High, Single) => "embree-high",
        (High, Packet) => "embree-high-packet",
        (High, Coherent) => "embree-high-coherent",
        (Robust, Single) => "embree-robust",
        (Robust, Packet) => "embree-robust-packet",
        (Robust, Coherent) => "embree-robust-coherent",
    }
}
