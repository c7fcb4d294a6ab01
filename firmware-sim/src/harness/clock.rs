//! The virtual clock: events in the order of their times.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

/// Events to come. Those of one time come by their order, and then by that of their scheduling.
#[derive(Clone, Debug)]
pub(super) struct Agenda<E> {
    now: Duration,
    scheduled: u64,
    events: BinaryHeap<Reverse<(Duration, E, u64)>>,
}

impl<E: Ord> Agenda<E> {
    /// An empty agenda at time 0.
    pub(super) const fn new() -> Self {
        Self { now: Duration::ZERO, scheduled: 0, events: BinaryHeap::new() }
    }

    /// The time of the event that came last.
    pub(super) const fn now(&self) -> Duration {
        self.now
    }

    /// Schedules an event, in the past for now.
    pub(super) fn at(&mut self, time: Duration, event: E) {
        self.scheduled += 1;
        self.events.push(Reverse((time.max(self.now), event, self.scheduled)));
    }

    /// The next event; the clock goes on to its time.
    pub(super) fn next(&mut self) -> Option<E> {
        let Reverse((time, event, _)) = self.events.pop()?;
        self.now = time;
        Some(event)
    }

    /// Drops the events that `keep` does not want.
    pub(super) fn retain(&mut self, keep: impl Fn(&E) -> bool) {
        self.events.retain(|Reverse((_, event, _))| keep(event));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_come_by_time_then_by_order_then_as_scheduled() {
        let ms = Duration::from_millis;
        let mut agenda = Agenda::new();
        for (time, event) in [(20, 'a'), (10, 'c'), (10, 'b'), (30, 'x'), (0, 'z')] {
            agenda.at(ms(time), event);
        }
        agenda.retain(|&event| event != 'x');
        assert_eq!((agenda.next(), agenda.next()), (Some('z'), Some('b')));
        // What is scheduled for the past comes now, and the clock never goes back.
        agenda.at(ms(5), 'd');
        assert_eq!((agenda.next(), agenda.now()), (Some('c'), ms(10)));
        assert_eq!((agenda.next(), agenda.now()), (Some('d'), ms(10)));
        assert_eq!((agenda.next(), agenda.next()), (Some('a'), None));
    }
}
