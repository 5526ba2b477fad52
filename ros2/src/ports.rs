//! The node of one robot: its topics and parameters.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use ros2_client::builtin_interfaces::Time;
use ros2_client::qos::{History, QosProfile, WhenFull};
use ros2_client::{
    Context, DEFAULT_SUBSCRIPTION_QOS, MessageTypeName, Name, Node, NodeName, NodeOptions, ParameterValue,
    Publisher, Subscription,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tokio::task::AbortHandle;

use crate::error::Ros2Error;
use crate::inbox::Inbox;
use crate::log::Log;
use crate::messages::{Clock, JointState, Path, Text, TfMessage, Twist};
use crate::steering::{Order, text};

/// Pause after a message that cannot be read.
const PAUSE: Duration = Duration::from_millis(100);

/// What a node's parameters say.
#[derive(Debug, Clone)]
pub(crate) struct Parameters {
    pub(crate) server: String,
    pub(crate) rate_hz: u32,
    pub(crate) pack: String,
    pub(crate) body: String,
    pub(crate) style: String,
    pub(crate) use_sim_time: bool,
    /// The styles that the pack has.
    pub(crate) styles: Vec<String>,
}

/// Topics of one robot.
pub(crate) struct Ports {
    node: Node,
    joints: Publisher<JointState>,
    tf: Publisher<TfMessage>,
    /// The newest time of `/clock`.
    clock: Arc<Mutex<Option<Time>>>,
    pub(crate) log: Log,
    tasks: Vec<AbortHandle>,
}

impl Ports {
    /// Joins ROS as the node `troupe` in the robot's namespace. Its orders go to `inbox`.
    ///
    /// # Errors
    /// See [`Ros2Error`].
    pub(crate) fn open(
        context: &Context,
        robot: &str,
        parameters: &Parameters,
        inbox: &Arc<Inbox>,
    ) -> Result<Self, Ros2Error> {
        let space = format!("/{robot}");
        let name = NodeName::new(&space, "troupe").map_err(|error| named(&space, &error))?;
        let mut node = context.new_node(name, options(parameters, inbox))?;
        let joints = joints(&mut node, &space)?;
        let tf = publisher(&mut node, ("/", "tf"), ("tf2_msgs", "TFMessage"), 100)?;
        let log = Log::new(robot, node.logging_handle());
        let clock = Arc::<Mutex<Option<Time>>>::default();

        let spinner = node.spinner()?;
        let mut tasks = vec![
            tokio::spawn(async move {
                if let Err(error) = spinner.spin().await {
                    tracing::warn!("parameters are not served: {error}");
                }
            })
            .abort_handle(),
        ];
        let sim = Arc::clone(&clock);
        let now = DEFAULT_SUBSCRIPTION_QOS;
        let of = subscription::<Clock>(&mut node, ("/", "clock"), ("rosgraph_msgs", "Clock"), &now)?;
        tasks.push(listen(of, &log, move |Clock { clock }| {
            *sim.lock().unwrap_or_else(PoisonError::into_inner) = Some(clock);
            Ok(())
        }));
        let orders = Orders {
            space,
            inbox,
            log: &log,
        };
        tasks.extend(orders.listen(&mut node, &parameters.styles)?);
        Ok(Self {
            node,
            joints,
            tf,
            clock,
            log,
            tasks,
        })
    }

    /// The time for stamps. None if it comes from `/clock`, and none has come.
    pub(crate) fn stamp(&self) -> Option<Time> {
        match self.node.get_parameter("use_sim_time") {
            Some(ParameterValue::Boolean(true)) => *self.clock.lock().unwrap_or_else(PoisonError::into_inner),
            _ => Some(Time::now()),
        }
    }

    /// Sends a pose without waiting: a subscriber that does not take its messages misses some.
    pub(crate) fn publish(&self, joints: JointState, tf: TfMessage) {
        let sent = self.joints.publish(joints).map_err(|error| error.to_string());
        let sent = sent.and(self.tf.publish(tf).map_err(|error| error.to_string()));
        if let Err(error) = sent {
            self.log.warn(&format!("a pose was not sent: {error}"));
        }
    }
}

impl Drop for Ports {
    fn drop(&mut self) {
        for task in &self.tasks {
            task.abort();
        }
    }
}

fn named(name: &str, reason: &impl ToString) -> Ros2Error {
    Ros2Error::Name {
        name: name.to_owned(),
        reason: reason.to_string(),
    }
}

/// Parameters: all can be read, and `style` and `use_sim_time` can be set.
fn options(parameters: &Parameters, inbox: &Arc<Inbox>) -> NodeOptions {
    let all = parameters.declared();
    let mut options = NodeOptions::new().enable_rosout(true);
    for (name, value) in &all {
        options = options.declare_parameter(name, value.clone());
    }
    let styles = parameters.styles.clone();
    let inbox = Arc::clone(inbox);
    let set = move |name: &str, value: &ParameterValue| {
        if let ("style", ParameterValue::String(style)) = (name, value)
            && !style.is_empty()
        {
            inbox.style(style.clone());
        }
        Ok(())
    };
    options
        .parameter_validator(Box::new(move |name, value| check(name, value, &all, &styles)))
        .parameter_set_action(Box::new(set))
}

impl Parameters {
    fn declared(&self) -> [(&'static str, ParameterValue); 6] {
        let word = |word: &str| ParameterValue::String(word.to_owned());
        [
            ("server", word(&self.server)),
            ("rate", ParameterValue::Integer(self.rate_hz.into())),
            ("pack", word(&self.pack)),
            ("body", word(&self.body)),
            ("style", word(&self.style)),
            ("use_sim_time", ParameterValue::Boolean(self.use_sim_time)),
        ]
    }
}

/// Checks the value of a parameter. The library checks `use_sim_time`.
///
/// # Errors
/// A sentence.
fn check(
    name: &str,
    value: &ParameterValue,
    declared: &[(&str, ParameterValue)],
    styles: &[String],
) -> Result<(), String> {
    if declared
        .iter()
        .any(|(known, first)| *known == name && first == value)
    {
        return Ok(());
    }
    match (name, value) {
        ("style", ParameterValue::String(style)) => known(style, styles),
        ("style", _) => Err("style must be a string".to_owned()),
        _ => Err(format!("{name} is set when the node starts")),
    }
}

/// Checks that the pack has a style.
///
/// # Errors
/// A sentence.
fn known(style: &str, styles: &[String]) -> Result<(), String> {
    match styles.iter().any(|known| known == style) {
        true => Ok(()),
        false => Err(format!(
            "style is {style:?}; allowed: {}. It is ignored",
            styles.join(", ")
        )),
    }
}

fn joints(node: &mut Node, space: &str) -> Result<Publisher<JointState>, Ros2Error> {
    publisher(node, (space, "joint_states"), ("sensor_msgs", "JointState"), 10)
}

fn topic(
    node: &Node,
    (space, name): (&str, &str),
    (package, kind): (&str, &str),
    qos: &QosProfile,
) -> Result<ros2_client::dds::rustdds::Topic, Ros2Error> {
    let name = Name::new(space, name).map_err(|error| named(name, &error))?;
    Ok(node.create_topic(&name, MessageTypeName::new(package, kind), qos)?)
}

/// A publisher with ROS's default quality: reliable, volatile.
fn publisher<M: Serialize>(
    node: &mut Node,
    name: (&str, &str),
    kind: (&str, &str),
    depth: usize,
) -> Result<Publisher<M>, Ros2Error> {
    let qos = QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Fail)
        .history(History::KeepLast { depth });
    let topic = topic(node, name, kind, &qos)?;
    Ok(node.create_publisher(&topic, Some(qos))?)
}

fn subscription<M: 'static>(
    node: &mut Node,
    name: (&str, &str),
    kind: (&str, &str),
    qos: &QosProfile,
) -> Result<Subscription<M>, Ros2Error> {
    let topic = topic(node, name, kind, qos)?;
    Ok(node.create_subscription(&topic, Some(qos.clone()))?)
}

/// Reads a topic until it is aborted. What cannot be taken is noted.
fn listen<M: DeserializeOwned + Send + Sync + 'static>(
    subscription: Subscription<M>,
    log: &Log,
    mut take: impl FnMut(M) -> Result<(), String> + Send + 'static,
) -> AbortHandle {
    let log = log.clone();
    let task = async move {
        loop {
            match subscription.async_take().await {
                Ok((message, _)) => {
                    if let Err(why) = take(message) {
                        log.warn(&why);
                    }
                }
                Err(error) => {
                    log.warn(&format!("a message cannot be read: {error}"));
                    tokio::time::sleep(PAUSE).await;
                }
            }
        }
    };
    tokio::spawn(task).abort_handle()
}

/// Where orders come from, and go to.
struct Orders<'a> {
    space: String,
    inbox: &'a Arc<Inbox>,
    log: &'a Log,
}

impl Orders<'_> {
    fn listen(&self, node: &mut Node, styles: &[String]) -> Result<[AbortHandle; 4], Ros2Error> {
        let inbox = || Arc::clone(self.inbox);
        let (drive, follow, say, wear) = (inbox(), inbox(), inbox(), inbox());
        let styles = styles.to_vec();
        let kind = ("std_msgs", "String");
        let twist = self.topic::<Twist>(node, "cmd_vel", ("geometry_msgs", "Twist"))?;
        let path = self.topic::<Path>(node, "path", ("nav_msgs", "Path"))?;
        let words = self.topic::<Text>(node, "say", kind)?;
        let style = self.topic::<Text>(node, "style", kind)?;
        Ok([
            listen(twist, self.log, move |twist| {
                Order::of_twist(&twist).map(|order| drive.order(order))
            }),
            listen(path, self.log, move |path| {
                Order::of_path(&path).map(|order| follow.order(order))
            }),
            listen(words, self.log, move |words| {
                Order::of_words(&words.data).map(|order| say.order(order))
            }),
            listen(style, self.log, move |style| {
                let style = text("style", &style.data)?;
                known(&style, &styles).map(|()| wear.style(style))
            }),
        ])
    }

    /// A topic of the robot. It is reliable, and keeps the newest message alone.
    fn topic<M: 'static>(
        &self,
        node: &mut Node,
        name: &str,
        kind: (&str, &str),
    ) -> Result<Subscription<M>, Ros2Error> {
        let qos = QosProfile::subscription_default().reliability_reliable(WhenFull::Fail);
        subscription(node, (&self.space, name), kind, &qos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_style_that_the_pack_lacks_is_refused_with_those_that_it_has() {
        let styles = ["slow".to_owned(), "walk".to_owned()];
        assert_eq!(known("slow", &styles), Ok(()));
        let why = known("fly", &styles).unwrap_err();
        assert_eq!(why, "style is \"fly\"; allowed: slow, walk. It is ignored");
    }

    #[test]
    fn a_style_can_be_set_and_what_the_node_began_with_cannot() {
        let parameters = Parameters {
            server: "http://a:1".to_owned(),
            rate_hz: 50,
            pack: "g1".to_owned(),
            body: String::new(),
            style: String::new(),
            use_sim_time: false,
            styles: vec!["slow".to_owned()],
        };
        let declared = parameters.declared();
        let of = |name: &str, value| check(name, &value, &declared, &parameters.styles);
        for (name, value) in declared.clone() {
            assert_eq!(of(name, value), Ok(()), "{name} as it was declared");
        }
        assert_eq!(of("style", ParameterValue::String("slow".to_owned())), Ok(()));
        assert!(of("style", ParameterValue::String("fly".to_owned())).is_err());
        assert_eq!(
            of("style", ParameterValue::Integer(1)).unwrap_err(),
            "style must be a string"
        );
        let why = of("rate", ParameterValue::Integer(30)).unwrap_err();
        assert_eq!(why, "rate is set when the node starts");
        assert!(of("pack", ParameterValue::String("other".to_owned())).is_err());
    }
}
