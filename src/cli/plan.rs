//! `wavepath plan`: what a scene needs and what was left out.

use crate::compile::compile;
use crate::error::Result;
use crate::integrator::plan::Plan;

use super::job::SceneJob;
use super::{Status, note, print};

pub(super) fn run(job: &SceneJob) -> Result<Status> {
    for warning in &job.scene.warnings {
        note(&format!("warning: {warning}"));
    }
    let film = job.scene.film;
    let compiled = compile(
        &job.scene,
        job.camera,
        film.width,
        film.height,
        &job.settings,
    )?;
    print(&format!(
        "{}, camera {}, {} × {} pixels\n{}{}\n{}\n",
        job.name(),
        job.camera_name(),
        film.width,
        film.height,
        job.load,
        job.load.total(),
        Plan::new(&compiled, &job.settings).to_string().trim_end(),
    ))
}
