//! The calls of `troupe.v1.Skeletons`, and skeletons and certificates as messages.

use troupe_character::Path;
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::retarget::Trial;
use troupe_proto::v1;

use super::error::SkeletonError;
use super::store::{Own, Skeletons};
use super::upload::upload;
use super::worn::Worn;
use crate::packs::{LoadedPack, PackTable};
use crate::wire::{joint_message, robot_message, vector_message};
use crate::world::UploadMemory;

impl Skeletons {
    /// `troupe.v1.Skeletons/PutSkeleton`. This takes milliseconds and may write a file.
    ///
    /// # Errors
    /// [`SkeletonError`]. Then nothing has changed.
    pub fn put_call(
        &self,
        request: &v1::PutSkeletonRequest,
        table: &PackTable,
        memory: &UploadMemory,
    ) -> Result<v1::OwnSkeleton, SkeletonError> {
        let of = body(table, &request.pack, &request.body)?;
        let doc = upload(request, of.0.rig(of.1))?;
        let own = self.put(doc, of, table, memory)?;
        message(&own, of, table)
    }

    /// `troupe.v1.Skeletons/GetSkeleton`. The first call for a body of a pack takes milliseconds.
    ///
    /// # Errors
    /// [`SkeletonError`] if there is no such skeleton, pack or body, or if no motion of the body
    /// can be carried over.
    pub fn get_call(
        &self,
        request: &v1::GetSkeletonRequest,
        table: &PackTable,
    ) -> Result<v1::OwnSkeleton, SkeletonError> {
        let own = self.get("name", &request.name)?;
        message(&own, body(table, &request.pack, &request.body)?, table)
    }

    /// `troupe.v1.Skeletons/ListSkeletons`.
    pub fn list_call(&self) -> v1::ListSkeletonsResponse {
        let summary = |own: &Own| v1::SkeletonSummary {
            name: own.doc.name.clone(),
            joint_count: own.figure.skeleton().joint_count() as u32,
            sessions: own.sessions() as u32,
        };
        v1::ListSkeletonsResponse {
            skeletons: self.list().iter().map(|own| summary(own)).collect(),
        }
    }

    /// `troupe.v1.Skeletons/DeleteSkeleton`. This blocks.
    ///
    /// # Errors
    /// [`SkeletonError`] if there is no such skeleton, or if sessions wear it.
    pub fn delete_call(
        &self,
        request: &v1::DeleteSkeletonRequest,
    ) -> Result<v1::DeleteSkeletonResponse, SkeletonError> {
        self.delete(&request.name)?;
        Ok(v1::DeleteSkeletonResponse {})
    }
}

fn body<'a>(table: &'a PackTable, pack: &str, body: &str) -> Result<(&'a LoadedPack, usize), SkeletonError> {
    let root = Path::root();
    let loaded = table.find(root.field("pack"), pack)?;
    Ok((loaded, loaded.place_of(root.field("body"), body)?))
}

fn message(own: &Own, of: (&LoadedPack, usize), table: &PackTable) -> Result<v1::OwnSkeleton, SkeletonError> {
    let worn = Skeletons::tried(own, of, table)?;
    let skeleton = own.figure.skeleton();
    let parts = PartsDoc::of(own.figure.parts(), skeleton);
    Ok(v1::OwnSkeleton {
        name: own.doc.name.clone(),
        joints: skeleton.joints.iter().map(joint_message).collect(),
        robot: (skeleton.robot.as_ref()).map(|robot| robot_message(robot, skeleton)),
        // Names and numbers can always be written.
        parts: toml::to_string(&parts).unwrap_or_default(),
        height: own.figure.root().y,
        notes: own.doc.notes.clone(),
        forced: own.doc.forced,
        fit: Some(fit(&worn, of)),
        left_axis: Some(vector_message(skeleton.left_axis)),
    })
}

fn fit(worn: &Worn, (loaded, place): (&LoadedPack, usize)) -> v1::SkeletonFit {
    let certificate = worn.certificate();
    let body = loaded.pack.bodies.get(place);
    v1::SkeletonFit {
        pack: loaded.pack.name().to_owned(),
        body: body.map(|body| body.name.clone()).unwrap_or_default(),
        scale: worn.scale(),
        trials: certificate.trials.iter().map(trial).collect(),
        faults: certificate.faults(),
        contact_joints: worn.contact_joints(),
    }
}

fn trial(trial: &Trial) -> v1::SkeletonTrial {
    let figures = &trial.figures;
    v1::SkeletonTrial {
        motion: trial.name.to_owned(),
        directions_deg: figures.directions_deg,
        worst_deg: figures.worst_deg,
        worst_joint: figures.joints.bone.clone(),
        lines_deg: figures.lines_deg,
        skate: figures.skate_mps,
        source_skate: figures.source_skate_mps,
        under_ground: figures.under_m,
        short: figures.short_m,
    }
}
