use troupe_character::testing::{PERSON_HIPS_M, figure_of, joints_of, person};

use super::super::registry::tests::Setup;
use super::*;
use crate::skeleton::Worn;

#[tokio::test]
async fn a_session_that_ends_lets_go_of_its_skeleton_while_others_keep_it() {
    let setup = Setup::new(1).await;
    let figure = |size: f32| figure_of(joints_of(&person(), size), None, size * PERSON_HIPS_M);
    let worn = Worn::between("hero", &figure(1.5), figure(1.0)).unwrap();
    for end in [End::Closed, End::Expired, End::MadeRoom] {
        let cell = setup.cell("hero");
        cell.live().dress = Some(worn.dress_for_session());
        // A look at its future is no wearer.
        let looked = cell.live().dress.as_ref().map(Dress::glimpse);
        assert_eq!(worn.wearers(), 1);
        // A plan under way keeps the session.
        assert!(cell.finish(end));
        assert_eq!(worn.wearers(), 0);
        drop((cell, looked));
    }
}
