//! A drafted definition as TOML with comments, as people write it.
//!
//! Tables of a list may stand anywhere in a TOML text, so what is added to a definition
//! ([`addition`]) goes behind its end.

use std::fmt::{Display, Write as _};

use troupe_motion::Skeleton;
use troupe_proto::docs::{
    ApproachDoc, EventDoc, KeyframeDoc, Moment, Motion, ObjectDoc, Origin, SetDoc, ShapeDoc, SocketDoc,
    VariantDoc,
};

/// What else the comments tell.
pub(super) struct Source<'a> {
    /// The clip's name.
    pub(super) clip: String,
    /// Its frame of each set.
    pub(super) frames: &'a [usize],
    /// The pack's name.
    pub(super) pack: &'a str,
    /// The networks of the pack made the poses.
    pub(super) rebuilt: bool,
    /// Whose joints the poses are of.
    pub(super) skeleton: &'a Skeleton,
}

/// The whole definition.
pub(super) fn whole(doc: &ObjectDoc, source: &Source<'_>) -> String {
    let mut text = Text::default();
    text.comment(format_args!("{}, {}.", doc.name, made(source)));
    text.comment("Metres, degrees about +Y, rotations as w, x, y, z. docs/objects.md explains the fields.");
    text.gap();
    text.value("format", doc.format);
    text.string("name", &doc.name);
    if !doc.description.is_empty() {
        text.string("description", &doc.description);
    }
    if !doc.solid {
        text.comment("A mere place: rays and boxes do not hit it.");
        text.value("solid", doc.solid);
    }
    if doc.shared {
        text.comment("Any number of characters may use it at once.");
        text.value("shared", doc.shared);
    }
    if let ShapeDoc::Box(shape) = &doc.shape {
        text.table("[shape.box]");
        text.numbers("center_m", &shape.center_m);
        text.numbers("half_extents_m", &shape.half_extents_m);
    }
    text.gap();
    text.comment("How near a character must be, metres from the shape.");
    text.line("[trigger]");
    text.number("reach_m", doc.trigger.reach_m);
    for approach in &doc.approaches {
        text.approach(approach);
    }
    text.use_of(doc, source);
    text.0
}

/// The whole skill.
pub(super) fn skill(doc: &ObjectDoc, source: &Source<'_>) -> String {
    let mut text = Text::default();
    text.comment(format_args!("{}, {}.", doc.name, made(source)));
    text.comment("Metres, degrees about +Y, rotations as w, x, y, z. docs/skills.md explains the fields. Each set is relative to the place at which the");
    text.comment("character is as it begins.");
    text.gap();
    text.value("format", doc.format);
    text.string("name", &doc.name);
    if !doc.description.is_empty() {
        text.string("description", &doc.description);
    }
    text.use_of(doc, source);
    text.0
}

/// What is added to a definition: the drafted variant, its sets, and its sockets but for those that
/// the definition has.
pub(super) fn addition(doc: &ObjectDoc, source: &Source<'_>) -> String {
    let mut text = Text::default();
    text.gap();
    let names: Vec<_> = doc.variants.iter().map(|variant| variant.name.as_str()).collect();
    text.comment(format_args!("Variant {}, {}.", names.join(", "), made(source)));
    text.use_of(doc, source);
    text.0
}

/// The command that made it.
fn made(source: &Source<'_>) -> String {
    let frames: Vec<_> = source.frames.iter().map(usize::to_string).collect();
    let whose = match source.rebuilt {
        true => "rebuilt by its networks; the poses are under the terms of its weights",
        false => "the poses are under the clip's licence",
    };
    format!(
        "made from {}, frames {}, for pack {}; {whose}",
        source.clip,
        frames.join(", "),
        source.pack
    )
}

#[derive(Default)]
struct Text(String);

impl Text {
    fn use_of(&mut self, doc: &ObjectDoc, source: &Source<'_>) {
        for socket in &doc.sockets {
            self.socket(socket);
        }
        for variant in &doc.variants {
            self.variant(variant);
        }
        for (nth, set) in doc.sets.iter().enumerate() {
            self.gap();
            if let Some(frame) = source.frames.get(nth) {
                self.comment(format_args!("Frame {frame} of the clip."));
            }
            self.set(set, source.skeleton);
        }
    }

    fn approach(&mut self, approach: &ApproachDoc) {
        self.gap();
        self.comment("The side that a character comes from, degrees from the object's +Z, and how far from its pivot it starts.");
        self.line("[[approaches]]");
        self.string("name", &approach.name);
        self.numbers("directions_deg", &approach.directions_deg);
        if let Some(distance) = approach.distance_m {
            self.number("distance_m", distance);
        }
    }

    fn socket(&mut self, socket: &SocketDoc) {
        self.gap();
        self.comment("Where the object is in the joint's frame while it is held.");
        self.line("[[sockets]]");
        self.string("name", &socket.name);
        self.string("joint", &socket.joint);
        self.numbers("position_m", &socket.position_m);
        if let Some(rotation) = &socket.rotation {
            self.numbers("rotation", rotation);
        }
        if socket.swings {
            self.line("swings = true");
        }
        if socket.upright {
            self.line("upright = true");
        }
    }

    fn variant(&mut self, variant: &VariantDoc) {
        self.table("[[variants]]");
        self.string("name", &variant.name);
        if variant.weight != 1.0 {
            self.number("weight", variant.weight);
        }
        self.string("entry", &variant.entry);
        if let Some(exit) = &variant.exit {
            self.string("exit", exit);
        }
    }

    fn set(&mut self, set: &SetDoc, skeleton: &Skeleton) {
        self.line("[[sets]]");
        self.string("name", &set.name);
        if let Some(next) = &set.next {
            self.string("next", next);
        }
        if set.origin == Origin::Character {
            self.comment("Relative to the character at that moment.");
            self.line("origin = \"character\"");
        }
        match set.motion {
            Some(Motion::Plan) => self.line("motion = \"plan\""),
            Some(Motion::Stance) => {
                self.comment("Without the networks, the feet held where they stand.");
                self.line("motion = \"stance\"");
            }
            None => {}
        }
        if set.from_stand {
            self.comment("A character that comes for it stops first.");
            self.value("from_stand", true);
        }
        if let Some(frames) = set.frames {
            self.comment("As long as in the clip.");
            self.value("frames", frames);
        }
        if set.drop_frames > 0 {
            self.comment("Soft: what follows may begin so many frames earlier.");
            self.value("drop_frames", set.drop_frames);
        }
        if set.hold_frames > 0 {
            self.value("hold_frames", set.hold_frames);
        }
        if set.hold_until_ended {
            self.value("hold_until_ended", true);
        }
        if !set.events.is_empty() {
            let events: Vec<_> = set.events.iter().map(event).collect();
            self.line(format_args!("events = [{}]", events.join(", ")));
        }
        for key in &set.keyframes {
            self.keyframe(key, skeleton);
        }
    }

    fn keyframe(&mut self, key: &KeyframeDoc, skeleton: &Skeleton) {
        self.table("[[sets.keyframes]]");
        if key.pivot {
            self.value("pivot", true);
        }
        if let Some(place) = &key.place_m {
            self.numbers("place_m", place);
        }
        if let Some(heading) = key.heading_deg {
            self.number("heading_deg", heading);
        }
        if let Some(height) = key.height_m {
            self.number("height_m", height);
        }
        if key.from_ground {
            self.value("from_ground", true);
        }
        if let Some(rotations) = &key.rotations {
            self.line("rotations = [");
            for (rotation, joint) in rotations.chunks(4).zip(&skeleton.joints) {
                self.line(format_args!("    {},  # {}", joined(rotation), joint.name));
            }
            self.line("]");
        }
        if !key.points.is_empty() {
            self.line("points = [");
            for point in &key.points {
                let position = joined(&point.position_m);
                self.line(format_args!(
                    "    {{ joint = {}, position_m = [{position}] }},",
                    quoted(&point.joint)
                ));
            }
            self.line("]");
        }
    }

    fn line(&mut self, line: impl Display) {
        // Writing to a text does not fail.
        let _ = writeln!(self.0, "{line}");
    }

    fn gap(&mut self) {
        self.line("");
    }

    fn comment(&mut self, comment: impl Display) {
        self.line(format_args!("# {comment}"));
    }

    fn table(&mut self, header: &str) {
        self.gap();
        self.line(header);
    }

    fn value(&mut self, field: &str, value: impl Display) {
        self.line(format_args!("{field} = {value}"));
    }

    fn string(&mut self, field: &str, text: &str) {
        self.value(field, quoted(text));
    }

    fn number(&mut self, field: &str, value: f32) {
        self.value(field, format_args!("{value:?}"));
    }

    fn numbers(&mut self, field: &str, values: &[f32]) {
        self.value(field, format_args!("[{}]", joined(values)));
    }
}

fn event(event: &EventDoc) -> String {
    let at = match event.at {
        Moment::Start => "at = \"start\", ",
        Moment::Reached => "",
        Moment::End => "at = \"end\", ",
    };
    match &event.attach {
        Some(socket) => format!("{{ {at}attach = {} }}", quoted(socket)),
        None => format!("{{ {at}release = {} }}", event.release),
    }
}

fn joined(numbers: &[f32]) -> String {
    let numbers: Vec<_> = numbers.iter().map(|number| format!("{number:?}")).collect();
    numbers.join(", ")
}

/// A text as TOML has it.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
