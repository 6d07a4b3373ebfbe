//! Lists of single rays for structures.

use glam::DVec3;

use crate::accel::{Accel, AccelCounters, HitBatch, RayBatch};
use crate::geometry::PrimitiveId;
use crate::integrator::clock::thread_cpu_seconds;
use crate::math::LANES;
use crate::math::float::flush_denormals;

/// Rays in columns.
#[derive(Debug, Default, Clone)]
pub(super) struct Rays {
    columns: [Vec<f32>; 6],
    skip: Vec<u32>,
}

impl Rays {
    /// Adds a ray that starts on the primitive `skip`, or on none.
    pub(super) fn push(&mut self, origin: [f32; 3], direction: [f32; 3], skip: u32) {
        let components = origin.into_iter().chain(direction);
        for (column, component) in self.columns.iter_mut().zip(components) {
            column.push(component);
        }
        self.skip.push(skip);
    }

    pub(super) fn len(&self) -> usize {
        self.skip.len()
    }

    /// Origin and direction of a ray.
    pub(super) fn ray(&self, i: usize) -> [[f32; 3]; 2] {
        [0, 3].map(|first| std::array::from_fn(|axis| self.columns[first + axis][i]))
    }

    /// The primitive that a ray starts on.
    pub(super) fn skip(&self, i: usize) -> u32 {
        self.skip[i]
    }

    /// Distance and primitive of the closest hits.
    pub(super) fn closest(&self, accel: &dyn Accel) -> Vec<(f32, u32)> {
        self.trace(accel).0
    }

    /// CPU seconds that finding the closest hits takes.
    pub(super) fn seconds(&self, accel: &dyn Accel) -> f64 {
        self.trace(accel).1
    }

    fn trace(&self, accel: &dyn Accel) -> (Vec<(f32, u32)>, f64) {
        let len = self.len();
        let size = len.next_multiple_of(LANES);
        // What lies past the last ray may be anything.
        let columns = self.columns.each_ref().map(|column| {
            let mut padded = column.clone();
            padded.resize(size, f32::NAN);
            padded
        });
        let mut skip = self.skip.clone();
        skip.resize(size, PrimitiveId::NONE);
        let (mut t, mut primitive) = (vec![0.0; size], vec![0; size]);
        let [ox, oy, oz, dx, dy, dz] = &columns;
        let rays = RayBatch {
            len,
            origin: [ox, oy, oz],
            direction: [dx, dy, dz],
            skip: &skip,
        };
        let hits = HitBatch {
            t: &mut t,
            primitive: &mut primitive,
        };
        let seconds = flushed(|| {
            let start = thread_cpu_seconds();
            accel.closest(rays, hits, &mut AccelCounters::default());
            thread_cpu_seconds() - start
        });
        (t.into_iter().zip(primitive).take(len).collect(), seconds)
    }
}

/// Runs on a thread of its own, which flushes denormals as the renderer's do.
pub(super) fn flushed<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    std::thread::scope(|scope| {
        let thread = scope.spawn(|| {
            flush_denormals();
            work()
        });
        thread.join().expect("the work does not panic")
    })
}

/// A vector of f32 in f64.
pub(super) fn wide(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// A vector of f64 rounded to f32.
pub(super) fn narrow(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}
