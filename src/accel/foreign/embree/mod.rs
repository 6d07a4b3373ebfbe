//! Embree 4, loaded at run time (Wald, Woop, Benthin, Johnson, Ernst, "Embree: A Kernel Framework for
//! Efficient CPU Ray Tracing", ACM TOG 33(4), 2014).
#![expect(unsafe_code, reason = "a C library is called")]

mod api;

pub use api::LIBRARY_VARIABLE;

use std::collections::HashMap;
use std::ffi::{CString, c_uint, c_void};
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};

use self::api::{Api, Arguments, Handle, INSTANCE_WORDS, PacketCall, RayHits, SingleCall, Valid};
use super::{EmbreeBuild, EmbreeCalls, embree_name};
use crate::accel::{Accel, AccelCounters, HitBatch, RayBatch, ShadowBatch};
use crate::error::{Error, Result};
use crate::geometry::{PrimitiveId, Triangle};

/// Triangles with their shared corners found, as Embree takes them.
#[derive(Debug)]
pub struct EmbreeMesh {
    vertices: Vec<[f32; 3]>,
    faces: Vec<[u32; 3]>,
}

impl EmbreeMesh {
    /// The mesh of the triangles; corners that are the same to the last bit are one vertex.
    pub fn new(triangles: &[Triangle]) -> Self {
        let mut index: HashMap<[u32; 3], u32> = HashMap::new();
        let mut vertices = Vec::new();
        let faces = triangles
            .iter()
            .map(|triangle| {
                triangle.corners.map(|corner| {
                    *index.entry(corner.map(f32::to_bits)).or_insert_with(|| {
                        vertices.push(corner);
                        vertices.len() as u32 - 1
                    })
                })
            })
            .collect();
        Self { vertices, faces }
    }
}

/// Bytes that Embree has allocated.
#[derive(Debug, Default)]
struct Memory {
    now: AtomicIsize,
    peak: AtomicIsize,
}

/// Adds up what Embree allocates; `memory` is a [`Memory`]. It always may.
unsafe extern "C" fn monitor(memory: *mut c_void, bytes: isize, _: bool) -> bool {
    // SAFETY: the scene that registered this keeps its `Memory` until the device is released.
    let memory = unsafe { &*memory.cast::<Memory>() };
    let now = memory.now.fetch_add(bytes, Ordering::Relaxed) + bytes;
    memory.peak.fetch_max(now, Ordering::Relaxed);
    true
}

/// A committed scene on a device of its own.
#[derive(Debug)]
pub struct EmbreeScene {
    api: &'static Api,
    device: Handle,
    /// Null until it is there.
    scene: Handle,
    /// What `monitor` has a pointer to.
    memory: Box<Memory>,
    build: EmbreeBuild,
}

// SAFETY: Embree documents its interface as safe to use from any thread, and a committed scene may be
// queried by many threads at once.
unsafe impl Send for EmbreeScene {}
// SAFETY: as above.
unsafe impl Sync for EmbreeScene {}

impl EmbreeScene {
    /// Builds over the mesh on `threads` threads.
    ///
    /// # Errors
    /// If the library is not found, is not Embree 4, or reports an error.
    pub fn new(mesh: &EmbreeMesh, build: EmbreeBuild, threads: usize) -> Result<Self> {
        let api = Api::load()?;
        let config = CString::new(format!("threads={threads}")).expect("there is no zero in it");
        // SAFETY: the string lives through the call.
        let device = unsafe { (api.new_device)(config.as_ptr()) };
        if device.is_null() {
            // SAFETY: without a device it tells why there is none.
            let code = unsafe { (api.device_error)(ptr::null_mut()) };
            return Err(failure(code, "does not start"));
        }
        let mut scene = Self {
            api,
            device,
            scene: ptr::null_mut(),
            memory: Box::default(),
            build,
        };
        let major = scene.property(api::property::VERSION) / 10_000;
        if major != 4 {
            return Err(Error::usage(format!(
                "the library is Embree {major}, not Embree 4"
            )));
        }
        scene.commit(mesh)?;
        Ok(scene)
    }

    fn property(&self, property: c_uint) -> isize {
        // SAFETY: the device is there until `self` is dropped.
        unsafe { (self.api.device_property)(self.device, property) }
    }

    /// An error if the device has met one since it was last asked.
    fn check(&self, what: &str) -> Result<()> {
        // SAFETY: as in `property`.
        match unsafe { (self.api.device_error)(self.device) } {
            0 => Ok(()),
            code => Err(failure(code, what)),
        }
    }

    fn commit(&mut self, mesh: &EmbreeMesh) -> Result<()> {
        let (quality, flags) = match self.build {
            EmbreeBuild::Medium => (api::quality::MEDIUM, 0),
            EmbreeBuild::High => (api::quality::HIGH, 0),
            EmbreeBuild::Robust => (api::quality::MEDIUM, api::SCENE_ROBUST),
        };
        let api = self.api;
        let memory: *const Memory = &raw const *self.memory;
        // SAFETY: the device is there; the box stays where it is until after the device is released.
        unsafe { (api.set_memory_monitor)(self.device, monitor, memory.cast_mut().cast()) };
        // SAFETY: the device is there.
        self.scene = unsafe { (api.new_scene)(self.device) };
        if self.scene.is_null() {
            return self.check("makes no scene").and(Err(null("scene")));
        }
        // SAFETY: the device is there.
        let geometry = unsafe { (api.new_geometry)(self.device, api::TRIANGLES) };
        if geometry.is_null() {
            return self.check("makes no geometry").and(Err(null("geometry")));
        }
        let filled = self
            .fill(
                geometry,
                api::buffer::VERTEX,
                api::format::FLOAT3,
                &mesh.vertices,
            )
            .and_then(|()| {
                self.fill(
                    geometry,
                    api::buffer::INDEX,
                    api::format::UINT3,
                    &mesh.faces,
                )
            });
        // SAFETY: scene and geometry are there; the scene keeps the geometry that is released here.
        unsafe {
            (api.set_scene_flags)(self.scene, flags);
            (api.set_scene_quality)(self.scene, quality);
            if filled.is_ok() {
                (api.set_geometry_quality)(geometry, quality);
                (api.commit_geometry)(geometry);
                (api.attach_geometry)(self.scene, geometry);
                (api.commit_scene)(self.scene);
            }
            (api.release_geometry)(geometry);
        }
        filled.and_then(|()| self.check("does not build"))
    }

    /// Copies items of 12 bytes into a new buffer of the geometry.
    fn fill<T: bytemuck::Pod>(
        &self,
        geometry: Handle,
        kind: c_uint,
        format: c_uint,
        items: &[[T; 3]],
    ) -> Result<()> {
        let stride = size_of::<[T; 3]>();
        // SAFETY: the geometry is there. Embree pads the buffer as its wide loads need.
        let buffer =
            unsafe { (self.api.new_buffer)(geometry, kind, 0, format, stride, items.len()) };
        if buffer.is_null() {
            return self.check("makes no buffer").and(Err(null("buffer")));
        }
        // SAFETY: the new buffer has room for as many items of that stride, and nothing else has it.
        unsafe { ptr::copy_nonoverlapping(items.as_ptr(), buffer.cast(), items.len()) };
        Ok(())
    }

    /// Most bytes that Embree held at once.
    pub fn peak_bytes(&self) -> usize {
        usize::try_from(self.memory.peak.load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// Version of the library: major, minor, patch.
    pub fn version(&self) -> [isize; 3] {
        let version = self.property(api::property::VERSION);
        [version / 10_000, version / 100 % 100, version % 100]
    }

    /// Rays per packet: 16 where the library traces them natively (with AVX-512), else 8.
    pub fn packet_width(&self) -> usize {
        if self.property(api::property::NATIVE_RAY16) != 0 {
            16
        } else {
            8
        }
    }
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: both are released once, the scene before its device, and only if they are there.
        unsafe {
            if !self.scene.is_null() {
                (self.api.release_scene)(self.scene);
            }
            (self.api.release_device)(self.device);
        }
    }
}

/// An `enum RTCError` in words.
fn failure(code: c_uint, what: &str) -> Error {
    let reason = match code {
        2 => "invalid argument",
        3 => "invalid operation",
        4 => "out of memory",
        5 => "unsupported CPU",
        6 => "cancelled",
        _ => "unknown error",
    };
    Error::limit(format!("Embree {what}: {reason}"))
}

/// For a null handle of which Embree reports no error.
fn null(what: &str) -> Error {
    Error::limit(format!("Embree returned no {what}"))
}

/// A scene queried by one kind of calls.
#[derive(Debug)]
pub struct Embree {
    scene: Arc<EmbreeScene>,
    calls: EmbreeCalls,
    packet_width: usize,
    name: &'static str,
}

impl Embree {
    /// The scene, queried by these calls.
    pub fn new(scene: &Arc<EmbreeScene>, calls: EmbreeCalls) -> Self {
        Self {
            calls,
            packet_width: scene.packet_width(),
            name: embree_name(scene.build, calls),
            scene: Arc::clone(scene),
        }
    }

    fn arguments(&self) -> Arguments {
        Arguments {
            flags: match self.calls {
                EmbreeCalls::Single | EmbreeCalls::Packet => api::query::INCOHERENT,
                EmbreeCalls::Coherent => api::query::COHERENT,
            },
            features: api::ALL_FEATURES,
            context: ptr::null_mut(),
            filter: ptr::null(),
            callback: ptr::null(),
            min_width_distance_factor: 0.0,
        }
    }

    /// Calls for each ray; `take` gets the number of the ray and the answer.
    fn single(
        &self,
        call: SingleCall,
        rays: &RayBatch<'_>,
        t_max: impl Fn(usize) -> f32,
        mut take: impl FnMut(usize, &RayHits<1>),
    ) {
        let mut arguments = self.arguments();
        let mut ray = RayHits::<1>::new();
        for at in 0..rays.len {
            ray.load(rays, at, 1, &t_max);
            // SAFETY: the scene is committed; ray and arguments are as the headers have them.
            unsafe { call(self.scene.scene, &raw mut ray, &raw mut arguments) };
            take(at, &ray);
        }
    }

    /// Calls for each packet of `N` rays in order, the last of which may be smaller.
    fn packets<const N: usize>(
        &self,
        call: PacketCall<N>,
        rays: &RayBatch<'_>,
        t_max: impl Fn(usize) -> f32,
        mut take: impl FnMut(usize, usize, &RayHits<N>),
    ) {
        let mut arguments = self.arguments();
        let mut packet = RayHits::<N>::new();
        for at in (0..rays.len).step_by(N) {
            let len = N.min(rays.len - at);
            packet.load(rays, at, len, &t_max);
            let valid = Valid(std::array::from_fn(|i| if i < len { -1 } else { 0 }));
            // SAFETY: the scene is committed; the packet is aligned and laid out as the headers have
            // it, and invalid rays are not read.
            unsafe {
                call(
                    &raw const valid,
                    self.scene.scene,
                    &raw mut packet,
                    &raw mut arguments,
                );
            };
            take(at, len, &packet);
        }
    }
}

impl<const N: usize> RayHits<N> {
    fn new() -> Self {
        Self {
            origin: [[0.0; N]; 3],
            t_near: [0.0; N],
            direction: [[0.0; N]; 3],
            time: [0.0; N],
            t_far: [0.0; N],
            mask: [u32::MAX; N],
            id: [0; N],
            flags: [0; N],
            normal: [[0.0; N]; 3],
            uv: [[0.0; N]; 2],
            primitive: [PrimitiveId::NONE; N],
            geometry: [u32::MAX; N],
            instance: [[u32::MAX; N]; INSTANCE_WORDS],
        }
    }

    /// The first `len` rays become those of the batch from `at` on.
    #[inline(always)]
    fn load(&mut self, rays: &RayBatch<'_>, at: usize, len: usize, t_max: impl Fn(usize) -> f32) {
        for axis in 0..3 {
            self.origin[axis][..len].copy_from_slice(&rays.origin[axis][at..at + len]);
            self.direction[axis][..len].copy_from_slice(&rays.direction[axis][at..at + len]);
        }
        for (i, t_far) in self.t_far[..len].iter_mut().enumerate() {
            *t_far = t_max(at + i);
        }
        // Embree's mark of a miss, and its field of a hit: the geometry has number 0.
        self.geometry = [u32::MAX; N];
    }

    /// Distance and primitive of the hit of ray `i`.
    #[inline(always)]
    fn hit(&self, i: usize) -> (f32, u32) {
        if self.geometry[i] == u32::MAX {
            (f32::INFINITY, PrimitiveId::NONE)
        } else {
            (self.t_far[i], self.primitive[i])
        }
    }
}

impl Accel for Embree {
    fn name(&self) -> &'static str {
        self.name
    }

    fn bytes(&self) -> usize {
        usize::try_from(self.scene.memory.now.load(Ordering::Relaxed)).unwrap_or(0)
    }

    fn closest(&self, rays: RayBatch<'_>, hits: HitBatch<'_>, _: &mut AccelCounters) {
        let api = self.scene.api;
        let t_max = |_| f32::INFINITY;
        let HitBatch { t, primitive } = hits;
        match (self.calls, self.packet_width) {
            (EmbreeCalls::Single, _) => self.single(api.intersect1, &rays, t_max, |at, ray| {
                (t[at], primitive[at]) = ray.hit(0);
            }),
            (_, 16) => self.packets(api.intersect16, &rays, t_max, |at, len, packet| {
                for i in 0..len {
                    (t[at + i], primitive[at + i]) = packet.hit(i);
                }
            }),
            _ => self.packets(api.intersect8, &rays, t_max, |at, len, packet| {
                for i in 0..len {
                    (t[at + i], primitive[at + i]) = packet.hit(i);
                }
            }),
        }
    }

    fn occluded(&self, rays: ShadowBatch<'_>, occluded: &mut [u32], _: &mut AccelCounters) {
        let api = self.scene.api;
        let t_max = |at: usize| rays.t_max[at];
        let rays = &rays.rays;
        // What is occluded has its end moved to −∞.
        match (self.calls, self.packet_width) {
            (EmbreeCalls::Single, _) => self.single(api.occluded1, rays, t_max, |at, ray| {
                occluded[at] = u32::from(ray.t_far[0] == f32::NEG_INFINITY);
            }),
            (_, 16) => self.packets(api.occluded16, rays, t_max, |at, len, packet| {
                for i in 0..len {
                    occluded[at + i] = u32::from(packet.t_far[i] == f32::NEG_INFINITY);
                }
            }),
            _ => self.packets(api.occluded8, rays, t_max, |at, len, packet| {
                for i in 0..len {
                    occluded[at + i] = u32::from(packet.t_far[i] == f32::NEG_INFINITY);
                }
            }),
        }
    }
}
