//! The skeleton onto which files are read, and how.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use troupe_motion::read::Options;
use troupe_motion::read::beside::mesh;
use troupe_motion::robot::description::{self, BuildOptions};
use troupe_motion::skeleton::Skeleton;

use crate::context::Context;
use crate::failure::Failure;
use crate::pack_folder;
use crate::reading::Reading;

const SKELETON: &str = "Skeleton";

/// Name, the joint that carries it, and its place there.
pub(crate) type EndEffector = (String, String, [f64; 3]);

/// Whose skeleton. Without any, files are read onto their own; a robot's files need one.
#[derive(Debug, Args)]
pub(crate) struct Onto {
    /// Read onto the skeleton of this model pack of the server.
    #[arg(long, value_name = "NAME", help_heading = SKELETON)]
    pack: Option<String>,

    /// Read onto the skeleton of the model pack in this folder, such as models/g1. No server is
    /// needed.
    #[arg(long, value_name = "DIR", conflicts_with = "pack", help_heading = SKELETON)]
    pack_folder: Option<PathBuf>,

    /// Read onto the robot of this URDF or MJCF file. No server is needed.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pack", "pack_folder"], help_heading = SKELETON)]
    urdf: Option<PathBuf>,

    /// Last hinges of the robot's legs, left before right. Default: the limbs that end lowest.
    #[arg(long, value_name = "JOINT,...", value_delimiter = ',', requires = "urdf", help_heading = SKELETON)]
    legs: Vec<String>,

    /// A joint without a hinge at a point of the robot's link, in its own axes and metres. Default:
    /// the sole's end and the hands, by collision shapes.
    #[arg(
        long,
        value_name = "NAME=JOINT:X,Y,Z",
        value_parser = end_effector,
        allow_hyphen_values = true,
        requires = "urdf",
        help_heading = SKELETON
    )]
    end_effector: Vec<EndEffector>,

    #[command(flatten)]
    reading: Reading,
}

impl Onto {
    /// The reader's options, to read onto the skeleton that the command line names.
    pub(crate) async fn options(&self, context: &Context) -> Result<Options, Failure> {
        let skeleton = self.skeleton(context).await?;
        Ok(self.reading.options(skeleton.as_ref()))
    }

    async fn skeleton(&self, context: &Context) -> Result<Option<Arc<Skeleton>>, Failure> {
        if let Some(file) = &self.urdf {
            return Ok(Some(Arc::new(Self::robot_of(
                file,
                &self.legs,
                &self.end_effector,
            )?)));
        }
        let pack = match (&self.pack_folder, &self.pack) {
            (Some(folder), _) => pack_folder::read(folder)?,
            (None, Some(name)) => context.connect_to_pack(name).await?.1,
            (None, None) => return Ok(None),
        };
        Ok(Some(Arc::clone(pack.skeleton())))
    }

    /// The robot of a URDF or MJCF file. `legs` are the last hinges of its legs; found if empty.
    pub(crate) fn robot_of(
        file: &Path,
        legs: &[String],
        end_effectors: &[EndEffector],
    ) -> Result<Skeleton, Failure> {
        let text = std::fs::read_to_string(file).map_err(|e| Failure::file(file, e))?;
        let folder = file.parent().unwrap_or(Path::new(""));
        let described =
            description::read(&text, &|name| mesh(folder, name)).map_err(|e| Failure::file(file, e))?;
        let options = BuildOptions {
            legs: legs.to_vec(),
            end_effectors: end_effectors.to_vec(),
        };
        let built = description::build(&described, &options).map_err(|e| Failure::file(file, e))?;
        Ok(built.skeleton)
    }
}

fn end_effector(text: &str) -> Result<EndEffector, String> {
    let parts = || {
        let (name, rest) = text.split_once('=')?;
        let (joint, place) = rest.rsplit_once(':')?;
        let numbers = place.split(',').map(|number| number.trim().parse().ok());
        let numbers = numbers.collect::<Option<Vec<f64>>>()?;
        Some((name.to_owned(), joint.to_owned(), numbers.try_into().ok()?))
    };
    parts().ok_or_else(|| "must be as left_toe=left_ankle_roll:0.14,0,-0.03".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_effector_has_a_name_a_joint_and_a_place() {
        let wanted = ("toe".to_owned(), "a:b".to_owned(), [0.1, 0.0, -0.03]);
        assert_eq!(end_effector("toe=a:b:0.1,0, -0.03"), Ok(wanted));
        for wrong in ["toe", "toe=ankle", "toe=ankle:1,2", "toe=ankle:x,y,z"] {
            assert!(end_effector(wrong).unwrap_err().contains("left_toe="), "{wrong}");
        }
    }
}
