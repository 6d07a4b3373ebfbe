//! The part of Embree 4's C interface that is used, declared after its public headers
//! (`include/embree4/rtcore_*.h`), and the search for the library.

use std::env;
use std::ffi::{c_char, c_int, c_uint, c_void};
use std::fs;
use std::path::{Path, PathBuf};

use libloading::Library;

use crate::error::{Error, Result};

/// Environment variable with the library's file, or a folder that has it.
pub const LIBRARY_VARIABLE: &str = "EMBREE_LIBRARY";

/// Names under which systems install the library.
const SYSTEM_NAMES: [&str; 4] = [
    "libembree4.so.4",
    "libembree4.so",
    "libembree4.4.dylib",
    "embree4.dll",
];

/// Levels of folders that are searched for the library.
const SEARCH_DEPTH: usize = 4;

/// An `RTCDevice`, `RTCScene` or `RTCGeometry`.
pub(super) type Handle = *mut c_void;

/// `enum RTCBuildQuality`.
pub(super) mod quality {
    use super::c_uint;
    pub(crate) const MEDIUM: c_uint = 1;
    pub(crate) const HIGH: c_uint = 2;
}

/// `RTC_SCENE_FLAG_ROBUST` of `enum RTCSceneFlags`.
pub(super) const SCENE_ROBUST: c_uint = 1 << 2;

/// `RTC_GEOMETRY_TYPE_TRIANGLE` of `enum RTCGeometryType`.
pub(super) const TRIANGLES: c_uint = 0;

/// `enum RTCBufferType`.
pub(super) mod buffer {
    use super::c_uint;
    pub(crate) const INDEX: c_uint = 0;
    pub(crate) const VERTEX: c_uint = 1;
}

/// `enum RTCFormat`.
pub(super) mod format {
    use super::c_uint;
    pub(crate) const UINT3: c_uint = 0x5003;
    pub(crate) const FLOAT3: c_uint = 0x9003;
}

/// `enum RTCDeviceProperty`.
pub(super) mod property {
    use super::c_uint;
    pub(crate) const VERSION: c_uint = 0;
    pub(crate) const NATIVE_RAY16: c_uint = 34;
}

/// `enum RTCRayQueryFlags`.
pub(super) mod query {
    use super::c_uint;
    pub(crate) const INCOHERENT: c_uint = 0;
    pub(crate) const COHERENT: c_uint = 1 << 16;
}

/// `RTC_FEATURE_FLAG_ALL` of `enum RTCFeatureFlags`.
pub(super) const ALL_FEATURES: c_uint = u32::MAX;

/// `struct RTCIntersectArguments` and `struct RTCOccludedArguments`, which have the same fields.
#[repr(C)]
#[derive(Debug)]
pub(super) struct Arguments {
    pub(super) flags: c_uint,
    pub(super) features: c_uint,
    pub(super) context: *mut c_void,
    pub(super) filter: *const c_void,
    pub(super) callback: *const c_void,
    /// Only in libraries built with `RTC_MIN_WIDTH`; others do not read so far.
    pub(super) min_width_distance_factor: f32,
}

/// Words that a hit has for instances: `instID` and, in some builds, `instPrimID`, for each of
/// `RTC_MAX_INSTANCE_LEVEL_COUNT` levels (1 by default). Room for more than any known build has.
pub(super) const INSTANCE_WORDS: usize = 16;

/// `struct RTCRayHit`, and `struct RTCRayHit8` and `RTCRayHit16` for packets of `N` rays. It starts
/// with the `struct RTCRay`. Aligned as the widest of them, which suits all.
#[repr(C, align(64))]
#[derive(Debug)]
pub(super) struct RayHits<const N: usize> {
    pub(super) origin: [[f32; N]; 3],
    pub(super) t_near: [f32; N],
    pub(super) direction: [[f32; N]; 3],
    pub(super) time: [f32; N],
    /// End of the segment; becomes the distance of the hit, or −∞ where something occludes.
    pub(super) t_far: [f32; N],
    pub(super) mask: [u32; N],
    pub(super) id: [u32; N],
    pub(super) flags: [u32; N],
    pub(super) normal: [[f32; N]; 3],
    pub(super) uv: [[f32; N]; 2],
    pub(super) primitive: [u32; N],
    pub(super) geometry: [u32; N],
    pub(super) instance: [[u32; N]; INSTANCE_WORDS],
}

/// Which rays of a packet are there: −1, else 0.
#[repr(C, align(64))]
#[derive(Debug)]
pub(super) struct Valid<const N: usize>(pub(super) [c_int; N]);

/// A call for packets of `N` rays: which are there, scene, rays, arguments.
pub(super) type PacketCall<const N: usize> =
    unsafe extern "C" fn(*const Valid<N>, Handle, *mut RayHits<N>, *mut Arguments);

/// A call for one ray.
pub(super) type SingleCall = unsafe extern "C" fn(Handle, *mut RayHits<1>, *mut Arguments);

/// Told of allocations: user pointer, bytes (negative when freed), whether it has happened already.
pub(super) type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

/// Declares the table of functions and fills it from a library.
macro_rules! functions {
    ($($field:ident = $symbol:literal: $kind:ty;)*) => {
        /// The functions of a loaded library.
        #[derive(Debug)]
        pub(super) struct Api {
            $(pub(super) $field: $kind,)*
        }

        impl Api {
            /// # Safety
            /// The library must be Embree 4, whose functions have these types.
            unsafe fn resolve(library: &Library) -> std::result::Result<Self, libloading::Error> {
                // SAFETY: promised by the caller.
                unsafe { Ok(Self { $($field: *library.get::<$kind>($symbol)?,)* }) }
            }
        }
    };
}

functions! {
    new_device = "rtcNewDevice": unsafe extern "C" fn(*const c_char) -> Handle;
    release_device = "rtcReleaseDevice": unsafe extern "C" fn(Handle);
    device_property = "rtcGetDeviceProperty": unsafe extern "C" fn(Handle, c_uint) -> isize;
    device_error = "rtcGetDeviceError": unsafe extern "C" fn(Handle) -> c_uint;
    set_memory_monitor = "rtcSetDeviceMemoryMonitorFunction":
        unsafe extern "C" fn(Handle, MemoryMonitor, *mut c_void);
    new_scene = "rtcNewScene": unsafe extern "C" fn(Handle) -> Handle;
    release_scene = "rtcReleaseScene": unsafe extern "C" fn(Handle);
    set_scene_flags = "rtcSetSceneFlags": unsafe extern "C" fn(Handle, c_uint);
    set_scene_quality = "rtcSetSceneBuildQuality": unsafe extern "C" fn(Handle, c_uint);
    attach_geometry = "rtcAttachGeometry": unsafe extern "C" fn(Handle, Handle) -> c_uint;
    commit_scene = "rtcCommitScene": unsafe extern "C" fn(Handle);
    new_geometry = "rtcNewGeometry": unsafe extern "C" fn(Handle, c_uint) -> Handle;
    set_geometry_quality = "rtcSetGeometryBuildQuality": unsafe extern "C" fn(Handle, c_uint);
    new_buffer = "rtcSetNewGeometryBuffer":
        unsafe extern "C" fn(Handle, c_uint, c_uint, c_uint, usize, usize) -> *mut c_void;
    commit_geometry = "rtcCommitGeometry": unsafe extern "C" fn(Handle);
    release_geometry = "rtcReleaseGeometry": unsafe extern "C" fn(Handle);
    intersect1 = "rtcIntersect1": SingleCall;
    intersect8 = "rtcIntersect8": PacketCall<8>;
    intersect16 = "rtcIntersect16": PacketCall<16>;
    occluded1 = "rtcOccluded1": SingleCall;
    occluded8 = "rtcOccluded8": PacketCall<8>;
    occluded16 = "rtcOccluded16": PacketCall<16>;
}

impl Api {
    /// Loads the library that [`LIBRARY_VARIABLE`] names, else the system's. It stays loaded: its
    /// threads may outlive the last device.
    pub(super) fn load() -> Result<&'static Self> {
        let candidates = match env::var_os(LIBRARY_VARIABLE) {
            Some(place) => vec![find(Path::new(&place))?],
            None => SYSTEM_NAMES.map(PathBuf::from).to_vec(),
        };
        let mut reason = String::new();
        for candidate in &candidates {
            // SAFETY: the user names the library, or it has Embree's name; its initialisers are run.
            match unsafe { Library::new(candidate) } {
                Ok(library) => {
                    let library: &'static Library = Box::leak(Box::new(library));
                    // SAFETY: the names are those of Embree 4, whose headers have these signatures.
                    let api = unsafe { Self::resolve(library) }
                        .map_err(|error| Error::file(candidate, one_line(&error)))?;
                    return Ok(Box::leak(Box::new(api)));
                }
                Err(error) => reason = one_line(&error),
            }
        }
        Err(Error::usage(match candidates.as_slice() {
            [one] => format!("{} cannot be loaded: {reason}", one.display()),
            _ => {
                format!("libembree4 was not found; {LIBRARY_VARIABLE} may name its file or folder")
            }
        }))
    }
}

fn one_line(error: &libloading::Error) -> String {
    error.to_string().replace('\n', " ")
}

/// The library's file: `place` itself, or one in that folder or below.
fn find(place: &Path) -> Result<PathBuf> {
    let kind = fs::metadata(place).map_err(|error| Error::io(place, &error))?;
    if !kind.is_dir() {
        return Ok(place.to_owned());
    }
    search(place, SEARCH_DEPTH).ok_or_else(|| {
        Error::file(
            place,
            format!("{LIBRARY_VARIABLE}: no libembree4 in this folder"),
        )
    })
}

fn search(folder: &Path, depth: usize) -> Option<PathBuf> {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .collect();
    entries.sort();
    let is_library = |path: &&PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // Wheels add a hash to the name.
        let named = name.starts_with("libembree4") || name.starts_with("embree4");
        let library = [".so", ".dylib", ".dll"];
        named && library.iter().any(|kind| name.contains(kind)) && path.is_file()
    };
    entries.iter().find(is_library).cloned().or_else(|| {
        let folders = entries.iter().filter(|path| depth > 1 && path.is_dir());
        folders.into_iter().find_map(|path| search(path, depth - 1))
    })
}

#[cfg(test)]
mod tests {
    use std::mem::{align_of, offset_of};

    use super::*;

    #[test]
    fn layouts_are_those_of_the_headers() {
        // struct RTCRayHit: a ray of 48 bytes, then Ng, u, v, primID, geomID, instID.
        assert_eq!(offset_of!(RayHits<1>, t_near), 12);
        assert_eq!(offset_of!(RayHits<1>, t_far), 32);
        assert_eq!(offset_of!(RayHits<1>, normal), 48);
        assert_eq!(offset_of!(RayHits<1>, primitive), 68);
        assert_eq!(offset_of!(RayHits<1>, instance), 76);
        // Packets: the hit begins at a multiple of its own alignment, so without a gap.
        assert_eq!(offset_of!(RayHits<8>, normal), 12 * 8 * 4);
        assert_eq!(offset_of!(RayHits<16>, normal), 12 * 16 * 4);
        assert_eq!(offset_of!(RayHits<16>, normal) % 64, 0);
        assert_eq!(align_of::<RayHits<16>>(), 64);
        assert_eq!(offset_of!(Arguments, context), 8);
        assert_eq!(offset_of!(Arguments, callback), 24);
    }

    #[test]
    fn folders_are_searched_for_the_library_and_files_taken_as_they_are() {
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().join("embreex.libs");
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("libtbb.so.12"), "").unwrap();
        assert!(find(directory.path()).is_err());
        let library = folder.join("libembree4-4aef3270.so.4");
        fs::write(&library, "").unwrap();
        assert_eq!(find(directory.path()).unwrap(), library);
        assert_eq!(find(&folder).unwrap(), library);
        assert_eq!(find(&library).unwrap(), library);
        assert!(find(&directory.path().join("nowhere")).is_err());
    }
}
