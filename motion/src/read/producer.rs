//! Which program or data set a file comes from, by the names of its joints.

use super::report::{Basis, Finding};

/// Part of a joint's name, and what has joints of such names.
const MARKS: [(&str, &str); 9] = [
    ("mixamorig", "Mixamo"),
    ("joint_Root", "Bandai Namco Research Motiondataset"),
    ("LHipJoint", "CMU Graphics Lab, converted"),
    ("LeftHipJoint", "CMU Graphics Lab, converted"),
    ("Bip01", "3ds Max Biped"),
    ("Bip001", "3ds Max Biped"),
    ("CC_Base_", "Character Creator"),
    ("J_Bip_", "VRoid"),
    ("ORG-", "Blender Rigify"),
];

/// The first that has such names.
pub(super) fn of_names(names: &[&str]) -> Option<Finding<String>> {
    MARKS.iter().find_map(|(mark, producer)| {
        let name = names.iter().find(|name| name.contains(mark))?;
        let evidence = format!("a joint is named {name:?}");
        Some(Finding::new((*producer).to_owned(), Basis::Found, evidence))
    })
}
