//! The intent of a character, and the part of it that was sent to the server.

use glam::Vec3;
use troupe_proto::v1;

use super::act::Act;

/// Move over the ground: velocity, facing, style. In the session's convention; by default, stand.
///
/// ```
/// use glam::Vec3;
/// use troupe_client::Locomotion;
///
/// // Strafe: go along +X at 1 m/s and keep facing +Z, as an old man.
/// let strafe = Locomotion::walk(Vec3::X).facing(0.0).style("elderly");
/// # assert_ne!(strafe, Locomotion::stand());
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Locomotion {
    /// Velocity over the ground, in the session's units per second. Zero: stand.
    pub velocity: Vec3,
    /// Heading to face, radians. None: along the velocity; standing keeps the heading.
    pub facing: Option<f32>,
    /// Style to move in. None: the current one.
    pub style: Option<String>,
    /// The only gait of the style to use. None: those that suit the velocity.
    pub gait: Option<String>,
    /// Height of the root joint in the session's unit, for styles that have a range of heights.
    /// None: the style's.
    pub height: Option<f32>,
}

impl Locomotion {
    /// Stand.
    pub fn stand() -> Self {
        Self::default()
    }

    /// Go with this velocity, in the session's units per second.
    pub fn walk(velocity: Vec3) -> Self {
        Self {
            velocity,
            ..Self::default()
        }
    }

    /// Faces this heading, radians, at any velocity.
    #[must_use]
    pub fn facing(mut self, heading: f32) -> Self {
        self.facing = Some(heading);
        self
    }

    /// Moves in this style.
    #[must_use]
    pub fn style(mut self, style: impl Into<String>) -> Self {
        self.style = Some(style.into());
        self
    }

    /// Uses this gait of the style alone.
    #[must_use]
    pub fn gait(mut self, gait: impl Into<String>) -> Self {
        self.gait = Some(gait.into());
        self
    }

    /// Holds the root joint at this height, in the session's unit.
    #[must_use]
    pub fn height(mut self, height: f32) -> Self {
        self.height = Some(height);
        self
    }

    /// The intent on the wire.
    pub fn to_message(&self) -> v1::Locomote {
        let Vec3 { x, y, z } = self.velocity;
        v1::Locomote {
            velocity: (self.velocity != Vec3::ZERO).then_some(v1::Vec3 { x, y, z }),
            facing: self.facing,
            style: self.style.clone().unwrap_or_default(),
            gait: self.gait.clone().unwrap_or_default(),
            height: self.height,
        }
    }
}

/// The intent of one character, the part of it that was sent, and the sequence numbers of commands.
#[derive(Debug, Clone, Default)]
pub(crate) struct Intent {
    wanted: Locomotion,
    sent: Option<Locomotion>,
    sequence: u64,
    /// Whether `wanted` was ever borrowed for a change. A resumed session continues as before until
    /// then.
    touched: bool,
    /// None: unchanged on the server.
    priority: Option<f32>,
    sent_priority: Option<f32>,
    /// Actions to send before the locomotion, in order.
    acts: Vec<v1::command::Intent>,
}

impl Intent {
    /// The intent of a session that has taken commands up to this sequence number.
    pub(crate) fn after(sequence: u64) -> Self {
        Self {
            sequence,
            ..Self::default()
        }
    }

    pub(crate) fn wanted(&self) -> &Locomotion {
        &self.wanted
    }

    pub(crate) fn wanted_mut(&mut self) -> &mut Locomotion {
        self.touched = true;
        &mut self.wanted
    }

    pub(crate) fn set_priority(&mut self, priority: f32) {
        self.priority = Some(priority);
    }

    /// The highest sequence number so far.
    pub(crate) fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Notes that the server has seen sequence numbers up to this one, from any client.
    pub(crate) fn seen(&mut self, sequence: u64) {
        self.sequence = self.sequence.max(sequence);
    }

    /// Adds an action. If the character does not move meanwhile, its locomotion counts as sent
    /// until it is borrowed for a change.
    pub(crate) fn act(&mut self, act: &Act) {
        let before = self.changed_intent();
        self.acts.extend(before);
        self.acts.push(act.to_message());
        if !act.lets_move() {
            self.sent = None;
            self.touched = false;
        }
    }

    /// Takes back a command that was not sent.
    pub(crate) fn unsent(&mut self, command: v1::Command) {
        match command.intent {
            Some(v1::command::Intent::Locomote(_)) | None => self.doubt(),
            Some(act) => self.acts.insert(0, act),
        }
    }

    /// The commands that bring the server up to date. They count as sent from now on.
    pub(crate) fn commands(&mut self, session: &str) -> Vec<v1::Command> {
        let acts = std::mem::take(&mut self.acts).into_iter();
        let mut commands: Vec<v1::Command> = acts
            .map(|act| v1::Command {
                session_id: session.to_owned(),
                sequence: self.next(),
                at_frame: None,
                intent: Some(act),
                priority: None,
            })
            .collect();
        commands.extend(self.changed(session));
        commands
    }

    /// The command with all changes that were not sent yet. They count as sent from now on.
    fn changed(&mut self, session: &str) -> Option<v1::Command> {
        let (intent, priority) = (self.changed_intent(), self.changed_priority());
        if intent.is_none() && priority.is_none() {
            return None;
        }
        Some(v1::Command {
            session_id: session.to_owned(),
            sequence: self.next(),
            at_frame: None,
            intent,
            priority,
        })
    }

    /// The locomotion, if it was not sent yet. It counts as sent from now on.
    fn changed_intent(&mut self) -> Option<v1::command::Intent> {
        let same = match &self.sent {
            Some(sent) => {
                let style = self.wanted.style.as_ref().or(sent.style.as_ref());
                style == sent.style.as_ref()
                    && self.wanted.velocity == sent.velocity
                    && self.wanted.facing == sent.facing
                    && self.wanted.gait == sent.gait
                    && self.wanted.height == sent.height
            }
            // A character without a command stands in its own style.
            None => !self.touched || (self.sequence == 0 && self.wanted == Locomotion::default()),
        };
        (!same).then(|| self.send_wanted())
    }

    /// The priority, if it was not sent yet. It counts as sent from now on.
    fn changed_priority(&mut self) -> Option<f32> {
        let changed = self
            .priority
            .filter(|priority| self.sent_priority.map(f32::to_bits) != Some(priority.to_bits()));
        self.sent_priority = self.priority;
        changed
    }

    fn next(&mut self) -> u64 {
        self.sequence = self.sequence.saturating_add(1);
        self.sequence
    }

    /// The wanted locomotion. It counts as sent from now on.
    fn send_wanted(&mut self) -> v1::command::Intent {
        let before = self.sent.take().and_then(|sent| sent.style);
        let mut sent = self.wanted.clone();
        sent.style = sent.style.or(before);
        self.sent = Some(sent);
        v1::command::Intent::Locomote(self.wanted.to_message())
    }

    /// A command with the next sequence number, which counts from `at_frame` on.
    pub(crate) fn command(&mut self, session: &str, at_frame: Option<u64>) -> v1::Command {
        v1::Command {
            session_id: session.to_owned(),
            intent: Some(self.send_wanted()),
            sequence: self.next(),
            at_frame,
            priority: self.changed_priority(),
        }
    }

    /// Marks everything as unsent, because the last command may not have arrived.
    pub(crate) fn doubt(&mut self) {
        self.sent_priority = None;
        // The style may not have arrived either, so it is sent again.
        if let Some(sent) = self.sent.take() {
            self.wanted.style = self.wanted.style.take().or(sent.style);
            // NaN differs from every value, so the next comparison finds a change.
            self.sent = Some(Locomotion {
                velocity: Vec3::NAN,
                ..Locomotion::default()
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn locomote(command: &v1::Command) -> &v1::Locomote {
        let Some(v1::command::Intent::Locomote(locomote)) = &command.intent else {
            panic!("{command:?}")
        };
        locomote
    }

    #[test]
    fn only_changes_are_sent_and_sequences_count_up() {
        let mut intent = Intent::default();
        assert_eq!(intent.changed("a"), None, "a new character stands by itself");
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z).style("old");
        let first = intent.changed("a").unwrap();
        assert_eq!(
            (first.session_id.as_str(), first.sequence, first.at_frame),
            ("a", 1, None)
        );
        assert_eq!(locomote(&first).style, "old");
        assert_eq!(intent.changed("a"), None);

        intent.wanted_mut().facing = Some(0.5);
        assert_eq!(intent.changed("a").unwrap().sequence, 2);
        *intent.wanted_mut() = Locomotion::stand();
        let third = intent.changed("a").unwrap();
        assert_eq!((third.sequence, locomote(&third).velocity), (3, None));
        assert_eq!(intent.changed("a"), None);
    }

    #[test]
    fn no_style_means_the_one_that_it_has() {
        let mut intent = Intent::default();
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z).style("old");
        intent.changed("a").unwrap();
        // The same without the style is no change.
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z);
        assert_eq!(intent.changed("a"), None);
        // Nor is the same style after another command without it.
        *intent.wanted_mut() = Locomotion::walk(Vec3::X);
        intent.changed("a").unwrap();
        *intent.wanted_mut() = Locomotion::walk(Vec3::X).style("old");
        assert_eq!(intent.changed("a"), None);
        *intent.wanted_mut() = Locomotion::walk(Vec3::X).style("young");
        assert_eq!(locomote(&intent.changed("a").unwrap()).style, "young");
    }

    #[test]
    fn an_uncertain_command_is_sent_again_with_a_new_number() {
        let mut intent = Intent::after(7);
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z).style("old");
        assert_eq!(intent.changed("a").unwrap().sequence, 8);
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z);
        intent.doubt();
        let again = intent.changed("a").unwrap();
        assert_eq!((again.sequence, locomote(&again).style.as_str()), (9, "old"));
        assert_eq!(intent.changed("a"), None);
        intent.seen(40);
        intent.wanted_mut().height = Some(0.8);
        assert_eq!(intent.changed("a").unwrap().sequence, 41);
    }

    #[test]
    fn a_priority_goes_with_the_next_command_or_alone() {
        let mut intent = Intent::default();
        intent.set_priority(0.2);
        let alone = intent.changed("a").unwrap();
        assert_eq!(
            (alone.sequence, alone.priority, &alone.intent),
            (1, Some(0.2), &None)
        );
        assert_eq!(intent.changed("a"), None);
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z);
        assert_eq!(intent.changed("a").unwrap().priority, None, "it is as it was");
        intent.set_priority(0.9);
        *intent.wanted_mut() = Locomotion::stand();
        let both = intent.changed("a").unwrap();
        assert_eq!((both.sequence, both.priority), (3, Some(0.9)));
        assert!(both.intent.is_some());
        intent.doubt();
        assert_eq!(intent.changed("a").unwrap().priority, Some(0.9));
    }

    #[test]
    fn an_invalid_priority_is_sent_once() {
        let mut intent = Intent::default();
        intent.set_priority(f32::NAN);
        assert!(intent.changed("a").unwrap().priority.unwrap().is_nan());
        assert_eq!(intent.changed("a"), None);
    }

    #[test]
    fn a_resumed_character_goes_on_until_its_intent_changes() {
        let mut intent = Intent::after(3);
        assert_eq!(intent.changed("a"), None);
        *intent.wanted_mut() = Locomotion::stand();
        assert_eq!(intent.changed("a").unwrap().sequence, 4);
    }

    fn sent(intent: &mut Intent) -> Vec<(u64, &'static str)> {
        use v1::command::Intent as Asked;
        let kind = |command: v1::Command| {
            let kind = match command.intent {
                Some(Asked::Locomote(_)) => "locomote",
                Some(Asked::Interact(_)) => "interact",
                Some(Asked::Skill(_)) => "skill",
                Some(Asked::Drop(_)) => "drop",
                Some(Asked::Cancel(_)) => "cancel",
                Some(Asked::EndInteraction(_)) => "end",
                Some(Asked::FollowPath(_)) => "path",
                Some(Asked::Perform(_)) => "perform",
                None => "none",
            };
            (command.sequence, kind)
        };
        intent.commands("a").into_iter().map(kind).collect()
    }

    #[test]
    fn acts_are_sent_once_and_the_same_motion_is_sent_again_after_them() {
        let mut intent = Intent::default();
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z);
        intent.act(&Act::interact("chair"));
        assert_eq!(sent(&mut intent), [(1, "locomote"), (2, "interact")]);
        assert_eq!(sent(&mut intent), []);
        // The same locomotion is a command too, because it ends the action.
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z);
        assert_eq!(sent(&mut intent), [(3, "locomote")]);
        intent.act(&Act::Drop);
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z);
        assert_eq!(sent(&mut intent), [(4, "drop")], "it walks on");
        intent.act(&Act::Cancel);
        *intent.wanted_mut() = Locomotion::walk(Vec3::X);
        assert_eq!(sent(&mut intent), [(5, "cancel"), (6, "locomote")]);
        intent.act(&Act::skill("jump"));
        assert_eq!(sent(&mut intent), [(7, "skill")]);
    }

    #[test]
    fn unsent_acts_are_sent_first() {
        let mut intent = Intent::default();
        intent.act(&Act::interact("chair"));
        *intent.wanted_mut() = Locomotion::walk(Vec3::Z);
        let unsent = intent.commands("a");
        unsent
            .into_iter()
            .rev()
            .for_each(|command| intent.unsent(command));
        assert_eq!(sent(&mut intent), [(3, "interact"), (4, "locomote")]);
    }

    #[test]
    fn standing_after_an_act_is_sent() {
        let mut intent = Intent::default();
        intent.act(&Act::interact("chair"));
        assert_eq!(sent(&mut intent), [(1, "interact")]);
        *intent.wanted_mut() = Locomotion::stand();
        assert_eq!(sent(&mut intent), [(2, "locomote")]);
    }

    #[test]
    fn without_a_sent_command_nothing_is_uncertain() {
        let mut intent = Intent::default();
        intent.doubt();
        assert_eq!(intent.changed("a"), None);
    }
}
