//! Orders to robots, one a line.

use glam::Vec3;
use troupe_client::LivePath;

use crate::robots::on_ground;

const VERBS: [&str; 9] = [
    "start", "end", "walk", "path", "go", "style", "stop", "wait", "quit",
];

/// How orders are written.
pub const FORMS: &str = "  [ROBOT,...] start          begin control, then follow the poses
  [ROBOT,...] walk X Y [DEG] go at X m/s ahead and Y m/s to the left, facing DEG (0 ahead, 90 left)
  [ROBOT,...] path X,Y X,Y   follow a path through these places, from where control began
  [ROBOT,...] go             follow the route of the file
  [ROBOT,...] style NAME     go on in this style
  [ROBOT,...] stop           stand, within a second
  [ROBOT,...] end            end control: the motors let go
  wait SECONDS               read the next line after this time
  quit                       all stand; then leave";

/// Whether a word is an order.
pub(crate) fn is_verb(word: &str) -> bool {
    VERBS.contains(&word)
}

/// An order that was read, or what the reader is to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Line {
    /// An order to robots. No names: all of them.
    Robots(Vec<String>, Order),
    /// Read on after this many seconds.
    Wait(f32),
    /// Leave.
    Quit,
}

/// What robots are to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// Begin control.
    Start,
    /// End control.
    End,
    /// Stand, within a second.
    Stop,
    /// Follow the route of the file.
    Go,
    /// Move.
    Move(Move),
}

/// An order that a session carries out.
#[derive(Debug, Clone, PartialEq)]
pub enum Move {
    /// Go at a velocity, in the session's axes, and face a heading.
    Walk(Vec3, Option<f32>),
    /// Follow a path.
    Path(LivePath),
    /// Change the style.
    Style(String),
    /// Stand.
    Stand,
}

impl Line {
    /// Reads a line. None for an empty one and for a comment.
    ///
    /// # Errors
    /// A sentence that says what is wrong.
    pub fn parse(line: &str) -> Result<Option<Self>, String> {
        let line = line.split('#').next().unwrap_or_default();
        let mut words: Vec<&str> = line.split_whitespace().collect();
        let mut robots = Vec::new();
        let Some(&first) = words.first() else {
            return Ok(None);
        };
        if !is_verb(first) && words.len() > 1 {
            robots = words.remove(0).split(',').map(str::to_owned).collect();
        }
        let order = match (words[0], &words[1..]) {
            ("start", []) => Order::Start,
            ("end", []) => Order::End,
            ("stop", []) => Order::Stop,
            ("go", []) => Order::Go,
            ("walk", &[x, y]) => Order::Move(Move::Walk(on_ground(number(x)?, number(y)?), None)),
            ("walk", &[x, y, degrees]) => Order::Move(Move::Walk(
                on_ground(number(x)?, number(y)?),
                Some(number(degrees)?.to_radians()),
            )),
            ("path", places) if places.len() > 1 => {
                let places: Result<Vec<Vec3>, String> = places.iter().map(|text| place(text)).collect();
                Order::Move(Move::Path(LivePath::through(places?)))
            }
            ("style", [name]) => Order::Move(Move::Style((*name).to_owned())),
            ("wait", [seconds]) if robots.is_empty() => {
                let seconds = number(seconds)?;
                return match (0.0..=86400.0).contains(&seconds) {
                    true => Ok(Some(Self::Wait(seconds))),
                    false => Err(format!("{seconds} s; allowed: 0 to 86400")),
                };
            }
            ("quit", []) if robots.is_empty() => return Ok(Some(Self::Quit)),
            _ => return Err(format!("{:?} is no order. Orders are:\n{FORMS}", line.trim())),
        };
        Ok(Some(Self::Robots(robots, order)))
    }
}

fn number(text: &str) -> Result<f32, String> {
    let number = text.parse::<f32>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| format!("{text:?} is no number"))
}

fn place(text: &str) -> Result<Vec3, String> {
    let (x, y) = text
        .split_once(',')
        .ok_or_else(|| format!("{text:?} is no place; write X,Y"))?;
    Ok(on_ground(number(x)?, number(y)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(order: Order) -> Option<Line> {
        Some(Line::Robots(Vec::new(), order))
    }

    #[test]
    fn lines_are_orders() {
        let parse = |line| Line::parse(line).unwrap();
        assert_eq!(parse("  start "), all(Order::Start));
        let ahead = Move::Walk(Vec3::new(0.0, 0.0, 0.8), None);
        assert_eq!(parse("walk 0.8 0"), all(Order::Move(ahead)));
        let Some(Line::Robots(names, Order::Move(Move::Walk(velocity, Some(facing))))) =
            parse("one,two walk 0 0.5 90 # aside")
        else {
            panic!()
        };
        assert_eq!((names.join(" "), velocity), ("one two".to_owned(), Vec3::X * 0.5));
        assert!((facing - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
        let Some(Line::Robots(_, Order::Move(Move::Path(path)))) = parse("path 0,0 2,1") else {
            panic!()
        };
        assert_eq!(path.points[1].position, Vec3::new(1.0, 0.0, 2.0));
        assert_eq!(
            parse("style slow"),
            all(Order::Move(Move::Style("slow".to_owned())))
        );
        assert_eq!(parse("wait 2.5"), Some(Line::Wait(2.5)));
        assert_eq!(parse("quit"), Some(Line::Quit));
        assert_eq!((parse(""), parse("# nothing")), (None, None));
    }

    #[test]
    fn what_is_no_order_is_said() {
        for (line, wanted) in [
            ("run", "\"run\" is no order"),
            ("one", "\"one\" is no order"),
            ("walk 1", "is no order"),
            ("walk 1 x", "\"x\" is no number"),
            ("walk 1 inf", "\"inf\" is no number"),
            ("path 1,2 3", "\"3\" is no place"),
            ("wait -1", "-1 s"),
            ("one quit", "is no order"),
        ] {
            let why = Line::parse(line).unwrap_err();
            assert!(why.contains(wanted), "{wanted}: {why}");
        }
    }
}
