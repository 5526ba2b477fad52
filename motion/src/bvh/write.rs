//! The BVH writer.

use std::fmt::Write as _;

use glam::DVec3;

use super::{BvhFile, BvhJoint};

/// Writes a BVH text that [`parse`](super::parse) reads back: numbers to six decimals, the frame
/// time in full.
///
/// Joints are written depth first. A file whose joints had another order is read back in this one;
/// every joint keeps its own channels and values.
pub fn write(file: &BvhFile) -> String {
    let mut children = vec![Vec::new(); file.joints.len()];
    let mut roots = Vec::new();
    for (index, joint) in file.joints.iter().enumerate() {
        match joint.parent {
            Some(parent) => children[parent].push(index),
            None => roots.push(index),
        }
    }
    let mut out = String::with_capacity(256 * file.joints.len() + 10 * file.values.len());
    out.push_str("HIERARCHY\n");
    let order = write_hierarchy(file, &roots, &children, &mut out);
    let columns = columns(&file.joints, &order);
    push(
        &mut out,
        format_args!(
            "MOTION\nFrames: {}\nFrame Time: {}\n",
            file.frames(),
            file.frame_time_s
        ),
    );
    for row in file.values.chunks_exact(file.channels) {
        for (nth, &column) in columns.iter().enumerate() {
            if nth > 0 {
                out.push(' ');
            }
            push_number(&mut out, row[column]);
        }
        out.push('\n');
    }
    out
}

/// Writes the joints depth first, without recursion, and returns the order in which they were
/// written.
fn write_hierarchy(file: &BvhFile, roots: &[usize], children: &[Vec<usize>], out: &mut String) -> Vec<usize> {
    /// A joint to open at some depth, or a block to close.
    enum Step {
        Open(usize, usize),
        Close(usize),
    }
    let mut order = Vec::with_capacity(file.joints.len());
    let mut todo: Vec<Step> = roots.iter().rev().map(|&r| Step::Open(r, 0)).collect();
    while let Some(step) = todo.pop() {
        match step {
            Step::Close(depth) => {
                indent(out, depth);
                out.push_str("}\n");
            }
            Step::Open(index, depth) => {
                order.push(index);
                write_joint(&file.joints[index], depth, out);
                todo.push(Step::Close(depth));
                todo.extend(children[index].iter().rev().map(|&c| Step::Open(c, depth + 1)));
            }
        }
    }
    order
}

fn write_joint(joint: &BvhJoint, depth: usize, out: &mut String) {
    indent(out, depth);
    push(
        out,
        format_args!(
            "{} {}\n",
            if joint.parent.is_some() { "JOINT" } else { "ROOT" },
            joint.name
        ),
    );
    indent(out, depth);
    out.push_str("{\n");
    write_offset(joint.offset, depth + 1, out);
    indent(out, depth + 1);
    push(out, format_args!("CHANNELS {}", joint.channels.len()));
    for channel in &joint.channels {
        push(out, format_args!(" {}", channel.name()));
    }
    out.push('\n');
    for &site in &joint.end_sites {
        indent(out, depth + 1);
        out.push_str("End Site\n");
        indent(out, depth + 1);
        out.push_str("{\n");
        write_offset(site, depth + 2, out);
        indent(out, depth + 1);
        out.push_str("}\n");
    }
}

fn write_offset(offset: DVec3, depth: usize, out: &mut String) {
    indent(out, depth);
    out.push_str("OFFSET");
    for value in offset.to_array() {
        out.push(' ');
        push_number(out, value);
    }
    out.push('\n');
}

/// For each number of a written row, its index in the file's own row.
fn columns(joints: &[BvhJoint], order: &[usize]) -> Vec<usize> {
    let mut starts = Vec::with_capacity(joints.len());
    let mut next = 0;
    for joint in joints {
        starts.push(next);
        next += joint.channels.len();
    }
    order
        .iter()
        .flat_map(|&j| starts[j]..starts[j] + joints[j].channels.len())
        .collect()
}

fn indent(out: &mut String, depth: usize) {
    out.extend(std::iter::repeat_n('\t', depth));
}

/// Six decimals, without trailing zeros.
fn push_number(out: &mut String, value: f64) {
    let start = out.len();
    push(out, format_args!("{value:.6}"));
    let kept = out[start..].trim_end_matches('0').trim_end_matches('.').len();
    out.truncate(start + kept);
    if &out[start..] == "-0" {
        out.replace_range(start.., "0");
    }
}

fn push(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing into a string cannot fail.
    let _ = out.write_fmt(text);
}
