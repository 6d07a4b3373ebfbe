//! Every structure answers every kind of ray as a scan of all triangles in f64 does, and all trees give
//! the same bits, whatever rays are asked together.

use rayon::ThreadPool;
use rayon::prelude::*;
use wavepath::accel::{Structure, build};
use wavepath::geometry::triangle::ShearRay;
use wavepath::geometry::{Geometry, PrimitiveId};
use wavepath::math::LANES;
use wavepath::report::accels::{Answers, RayKind, RaySet, answers};

use crate::mesh_scenes::{MeshScene, folder, made, read};
use crate::triangle_oracle::{Meeting, Ray, Test};

/// Rays per call where it does not matter.
const BATCH: usize = 1024;

/// Distances by Woop's test within so many units in the last place of t are within a few.
const FEW_ULPS: f64 = 8.0;

/// Rays of a set, of which some are judged.
const SET: usize = 4_096;

/// One hit in so many may be another triangle's than that which f64 finds nearest: it is at the same
/// distance, or the ray starts on it, within what roundings may do.
const MOST_TIES: usize = 25;

/// One hit in so many may be off by more than [`FEW_ULPS`], within its bound: seen at a grazing angle.
const MOST_FAR_OFF: usize = 10;

/// Triangles held against rays in f64 for each kind of ray over a real mesh.
const TESTS: usize = 15_000_000;

fn pool() -> ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .build()
        .expect("two threads")
}

/// What a set's answers showed.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    /// Rays that hit something.
    hits: usize,
    /// Hits of another triangle than the nearest without roundings.
    ties: usize,
    /// Hits, certain ones, that are more than [`FEW_ULPS`] off.
    far_off: usize,
}

impl Tally {
    fn plus(self, other: Self) -> Self {
        Self {
            hits: self.hits + other.hits,
            ties: self.ties + other.ties,
            far_off: self.far_off + other.far_off,
        }
    }
}

/// Holds the answers against all triangles. A structure may hit what roundings may make a hit, and miss
/// what they may make a miss, but nothing else; of every hit the distance is within its bound.
fn judge(
    geometry: &Geometry,
    (rays, candidates): (&RaySet, &[Vec<u32>]),
    answers: &Answers,
    test: Test,
    name: &str,
) -> Tally {
    let of_ray = |i: usize| {
        let (origin, direction, end) = rays.ray(i);
        let ray = Ray::new(origin, direction);
        let met: Vec<(u32, Meeting)> = candidates[i]
            .iter()
            .filter_map(|&id| Some((id, ray.meet(test, &geometry.triangles[id as usize])?)))
            .collect();
        let certainly_before = |end: f64| {
            met.iter()
                .any(|(_, meeting)| meeting.certain && meeting.t + meeting.bound < end)
        };
        match answers {
            Answers::Occluded(occluded) => {
                let end = f64::from(end);
                let right = if occluded[i] {
                    met.iter().any(|(_, m)| m.t - m.bound < end)
                } else {
                    !certainly_before(end)
                };
                assert!(right, "{name}, ray {i}: occluded is {}", occluded[i]);
                Tally {
                    hits: usize::from(occluded[i]),
                    ..Tally::default()
                }
            }
            Answers::Closest(hits) => {
                let (t, id) = hits[i];
                assert!(!certainly_before(t.into()), "{name}, ray {i}: a nearer hit");
                if id == PrimitiveId::NONE {
                    return Tally::default();
                }
                let found = met.iter().find(|(met, _)| *met == id);
                let Some((_, meeting)) = found else {
                    panic!("{name}, ray {i}: {id} is not on the ray");
                };
                let apart = (f64::from(t) - meeting.t).abs();
                assert!(
                    apart <= meeting.bound,
                    "{name}, ray {i}: {t}, {apart} from {}, bound {}",
                    meeting.t,
                    meeting.bound
                );
                let ulp = f64::from(t.next_up() - t);
                let nearest = met
                    .iter()
                    .filter(|(_, meeting)| meeting.exact)
                    .min_by(|a, b| a.1.t.total_cmp(&b.1.t));
                Tally {
                    hits: 1,
                    ties: usize::from(nearest.is_none_or(|nearest| nearest.0 != id)),
                    far_off: usize::from(meeting.certain && apart > FEW_ULPS * ulp),
                }
            }
        }
    };
    (0..rays.len())
        .into_par_iter()
        .map(of_ray)
        .reduce(Tally::default, Tally::plus)
}

/// Holds every structure's answers to `count` rays of each kind against f64. All trees must give the same
/// bits, so that one of them is judged for all.
fn judge_all(name: &str, scene: &MeshScene, count: usize) {
    let pool = pool();
    let geometry = scene.unmerged();
    let accels = Structure::ALL.map(|structure| build(structure, &geometry).expect("builds"));
    let mut totals = [Tally::default(); 2];
    for rays in scene.rays(SET) {
        let kind = rays.kind().name();
        let rays = rays.sample(count);
        let given = accels
            .each_ref()
            .map(|accel| answers(&pool, &**accel, &rays, BATCH));
        let [scan, tree, others @ ..] = &given;
        for (accel, other) in accels[2..].iter().zip(others) {
            assert!(other == tree, "{name}, {}, {kind}", accel.name());
        }
        let candidates = |i: usize| {
            let (origin, direction, _) = rays.ray(i);
            Ray::new(origin, direction).candidates(&geometry.triangles)
        };
        let candidates: Vec<Vec<u32>> =
            pool.install(|| (0..rays.len()).into_par_iter().map(candidates).collect());
        let judged = [(scan, Test::Planar), (tree, Test::Sheared)];
        for (total, (answers, test)) in totals.iter_mut().zip(judged) {
            let label = format!("{name}, {test:?}, {kind}");
            let tally =
                pool.install(|| judge(&geometry, (&rays, &candidates), answers, test, &label));
            assert!(tally.hits > 0, "{label}: no hits");
            *total = total.plus(tally);
        }
    }
    for total in totals {
        assert!(total.ties <= total.hits / MOST_TIES, "{name}: {total:?}");
        assert!(
            total.far_off <= total.hits / MOST_FAR_OFF,
            "{name}: {total:?}"
        );
    }
}

/// Kinds of meshes made by formula, and about how many triangles they get.
const MADE: [(&str, u32); 6] = [
    ("icosphere", 5_120),
    ("torus", 4_000),
    ("sponge", 2_112),
    ("hairball", 4_000),
    ("terrain", 4_000),
    ("soup", 4_000),
];

#[test]
fn every_structure_hits_what_f64_hits_with_every_kind_of_ray() {
    for (kind, triangles) in MADE {
        let scene = MeshScene::new(&made(kind, triangles), [64, 48]);
        judge_all(kind, &scene, 500);
    }
}

#[test]
#[allow(
    clippy::print_stderr,
    reason = "tells the developer that the test did nothing"
)]
fn every_structure_hits_what_f64_hits_on_real_meshes() {
    let Some(folder) = folder() else {
        eprintln!("skipped: set WAVEPATH_MESHES to a folder of OBJ files");
        return;
    };
    for file in [
        "small/teapot.obj",
        "small/stanford-bunny.obj.zst",
        "small/propeller.obj.zst",
        "medium/sponza-crytek/sponza.obj.zst",
    ] {
        let scene = MeshScene::new(&read(&folder, file), [64, 48]);
        let count = (TESTS / scene.geometry.len()).min(500);
        judge_all(file, &scene, count);
    }
}

/// The nearest hits by the scalar test, one triangle after the other; of equal ones the first.
fn plain_loop(geometry: &Geometry, rays: &RaySet) -> Answers {
    let nearest = |i: usize| {
        let (origin, direction, _) = rays.ray(i);
        let ray = ShearRay::new(origin, direction);
        let hits = (0u32..).zip(&geometry.triangles);
        hits.filter_map(|(id, triangle)| Some((ray.intersect(triangle)?, id)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((f32::INFINITY, PrimitiveId::NONE))
    };
    let hits: Vec<(f32, u32)> = (0..rays.len()).into_par_iter().map(nearest).collect();
    if rays.kind() == RayKind::Shadow {
        let end = |i: usize| rays.ray(i).2;
        Answers::Occluded((0..rays.len()).map(|i| hits[i].0 < end(i)).collect())
    } else {
        Answers::Closest(hits)
    }
}

#[test]
fn trees_give_the_bits_of_a_plain_loop_in_batches_of_any_size() {
    let pool = pool();
    for (kind, triangles) in MADE {
        let scene = MeshScene::new(&made(kind, triangles), [64, 48]);
        let geometry = scene.unmerged();
        let accels = Structure::ALL.map(|structure| build(structure, &geometry).expect("builds"));
        let [scan, trees @ ..] = &accels;
        for all in scene.rays(5_000) {
            let few = all.sample(300);
            let plain = pool.install(|| plain_loop(&geometry, &few));
            let of_few = answers(&pool, &*trees[0], &few, BATCH);
            assert!(of_few == plain, "{kind}, {}", all.kind().name());

            // The scan has a test of its own, but the same bits in every batch.
            let scan = [(scan, &few, answers(&pool, &**scan, &few, BATCH))];
            let expected = answers(&pool, &*trees[0], &all, BATCH);
            let trees = trees.iter().map(|tree| (tree, &all, expected.clone()));
            for (accel, rays, expected) in trees.chain(scan) {
                for batch in [1, LANES - 1, LANES, LANES + 1, 4_096] {
                    assert!(
                        answers(&pool, &**accel, rays, batch) == expected,
                        "{kind}, {}, {}, batches of {batch}",
                        accel.name(),
                        rays.kind().name()
                    );
                }
            }
        }
    }
}
