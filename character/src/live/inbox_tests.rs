use super::*;
use crate::live::behaviour::testing::doll_style;
use crate::primitives::LocomotionCommand;

fn walk() -> Intent {
    Intent::Locomote(LocomotionCommand::standing(&doll_style()))
}

fn interact() -> Intent {
    Intent::Interact {
        instance: "cup".into(),
        variant: None,
        approach: None,
    }
}

/// The sequence numbers of the commands that hold at a frame, in order.
fn due(inbox: &mut Inbox, frame: u64) -> Vec<u64> {
    std::iter::from_fn(|| inbox.take_due(frame))
        .map(|due| due.sequence)
        .collect()
}

#[test]
fn due_commands_come_in_order_with_the_newest_walk() {
    let mut inbox = Inbox::default();
    inbox.offer(1, 0, walk());
    inbox.offer(2, 0, Intent::Drop);
    inbox.offer(3, 0, walk());
    inbox.offer(4, 5, Intent::EndInteraction);
    inbox.offer(5, 0, interact());
    assert_eq!(inbox.offer(5, 0, Intent::Drop), CommandOutcome::Repeated);
    assert_eq!(inbox.offer(4, 0, Intent::Drop), CommandOutcome::Late);
    assert_eq!(inbox.waiting().map(|waiting| waiting.sequence), Some(2));
    assert_eq!(due(&mut inbox, 4), [2, 3, 5]);
    assert_eq!(inbox.waiting().map(|waiting| waiting.sequence), Some(4));
    assert_eq!((due(&mut inbox, 5), due(&mut inbox, 9)), (vec![4], vec![]));
}

#[test]
fn only_a_walk_replaces_a_waiting_walk() {
    let mut inbox = Inbox::default();
    inbox.offer(1, 12, walk());
    inbox.offer(2, 0, Intent::Drop);
    assert_eq!(due(&mut inbox, 0), [2]);
    inbox.offer(3, 20, walk());
    assert_eq!((due(&mut inbox, 19), due(&mut inbox, 20)), (vec![], vec![3]));
}

#[test]
fn a_waiting_interaction_gives_way() {
    for intent in [interact(), Intent::Cancel] {
        let mut inbox = Inbox::default();
        inbox.offer(1, 7, interact());
        inbox.offer(2, 7, Intent::EndInteraction);
        inbox.offer(3, 7, intent);
        assert_eq!(due(&mut inbox, 7), [2, 3]);
    }
    let mut inbox = Inbox::default();
    inbox.offer(1, 7, interact());
    inbox.offer(2, 7, Intent::Drop);
    assert_eq!(due(&mut inbox, 7), [1, 2]);
}

#[test]
fn the_number_of_waiting_commands_is_limited() {
    let mut inbox = Inbox::default();
    for sequence in 1..=MAX_WAITING_COMMANDS as u64 {
        inbox.check(&interact()).unwrap();
        let intent = if sequence == 3 { interact() } else { Intent::Drop };
        inbox.offer(sequence, 9, intent);
    }
    let full = inbox.check(&Intent::Drop).unwrap_err();
    assert_eq!(
        full.to_string(),
        "8 commands of the session wait for their frames; at most 8 may, beside a locomote"
    );
    // A walk needs no room, and a command that replaces another takes its room.
    inbox.check(&walk()).unwrap();
    inbox.check(&interact()).unwrap();
    inbox.offer(20, 9, interact());
    assert_eq!(due(&mut inbox, 9), [1, 2, 4, 5, 6, 7, 8, 20]);
    inbox.check(&Intent::Drop).unwrap();
}
