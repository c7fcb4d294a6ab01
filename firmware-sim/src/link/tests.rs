use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_core::units::{Cost, CostLimit};
use armor_infer::Policy;
use armor_infer::link::{Answer, Receiver, decode};

use super::*;
use crate::fixture;
use crate::host::HostController;
use crate::memory::AlignedBytes;

/// What no test waits out.
const LONG: Duration = Duration::from_secs(60);
/// What a test does wait out.
const SHORT: Duration = Duration::from_millis(30);
/// What a test waits out where the other end must answer within four of them.
const ENOUGH: Duration = Duration::from_millis(120);

/// Runs a check with the two ends of a connection.
fn connected() -> (TcpStream, TcpStream) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let plant = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    (plant, listener.accept().unwrap().0)
}

fn limit() -> Cost {
    CostLimit::new(5.0).unwrap().cost()
}

fn state(tick: usize) -> [f32; 7] {
    std::array::from_fn(|entry| (tick + entry) as f32 / 50.0)
}

/// The budgets and actions of an episode of the fixture, without a link.
fn flown_at_hand(ticks: usize, seed: u64) -> Vec<(Cost, Vec<f32>)> {
    let memory = AlignedBytes::from(fixture::ball_run(1).as_slice());
    let policy = Policy::load(&PolicyImage::new_checked(memory.as_slice()).unwrap()).unwrap();
    let mut controller = HostController::new(policy, CostLimit::from_cost(limit()), seed).unwrap();
    let flown = (0..ticks).map(|tick| {
        let step = controller.step(&state(tick), incurred(tick));
        (step.kappa, step.action.as_slice()[..2].to_vec())
    });
    flown.collect()
}

const fn incurred(tick: usize) -> f32 {
    if tick % 4 == 3 { 0.5 } else { 0.0 }
}

/// The same episode over a line.
fn flown_over(client: &mut Client<impl Read + Write>, ticks: usize, seed: u64) -> Vec<(Cost, Vec<f32>)> {
    assert_eq!(client.hello().unwrap().task, "ball-run");
    assert_eq!(client.reset(limit(), seed).unwrap(), limit());
    let flown = (0..ticks).map(|tick| {
        let answer = client.step(&state(tick), incurred(tick)).unwrap();
        (answer.kappa, answer.action.to_vec())
    });
    flown.collect()
}

/// Serves the fixture on a line, on a thread, until the plant leaves.
fn serving(
    mut line: impl Read + Write + Send + 'static,
    patience: Duration,
) -> thread::JoinHandle<Result<u32, String>> {
    thread::spawn(move || {
        let memory = AlignedBytes::from(fixture::ball_run(1).as_slice());
        let image = PolicyImage::new_checked(memory.as_slice()).unwrap();
        let mut endpoint = HostEndpoint::new(&image, usize::MAX).unwrap();
        let mut actions = 0;
        let served = serve(&mut line, &mut endpoint, patience, |(answer, _)| {
            actions += u32::from(matches!(answer, Answer::Act { .. }));
        });
        served.map(|()| actions).map_err(|error| error.to_string())
    })
}

#[test]
fn an_episode_over_tcp_is_the_controllers_own() {
    let (plant, served) = connected();
    let server = serving(patient_socket(served, LONG).unwrap(), LONG);
    let mut client = Client::new(patient_socket(plant, LONG).unwrap());
    assert_eq!(flown_over(&mut client, 50, 9), flown_at_hand(50, 9));
    drop(client);
    assert_eq!(server.join().unwrap(), Ok(50));
}

#[test]
fn an_episode_over_pipes_is_the_controllers_own() {
    let (requests, to_server) = io::pipe().unwrap();
    let (answers, to_plant) = io::pipe().unwrap();
    let server = serving(PatientPipe::new(requests, to_plant, LONG), LONG);
    let mut client = Client::new(PatientPipe::new(answers, to_server, LONG));
    assert_eq!(flown_over(&mut client, 50, 9), flown_at_hand(50, 9));
    drop(client);
    assert_eq!(server.join().unwrap(), Ok(50));
}

/// A line that damages what passes: every `nth` frame each way is lost, doubled
/// or broken, in turn.
struct Faulty {
    line: TcpStream,
    nth: usize,
    frames: usize,
}

impl Faulty {
    fn damaged(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut passed = Vec::new();
        for frame in bytes.split_inclusive(|&byte| byte == 0) {
            self.frames += 1;
            let mut frame = frame.to_vec();
            if self.frames.is_multiple_of(self.nth) {
                match self.frames / self.nth % 4 {
                    0 => frame.clear(),
                    1 => frame.extend(frame.clone()),
                    2 => frame[1] ^= 0x10,
                    _ => frame.truncate(3),
                }
            }
            passed.extend(frame);
        }
        passed
    }
}

impl Read for Faulty {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let length = self.line.read(&mut buffer[..ANSWER_FRAME / 2])?;
        let damaged = self.damaged(&buffer[..length]);
        if damaged.is_empty() {
            return Err(ErrorKind::TimedOut.into());
        }
        buffer[..damaged.len()].copy_from_slice(&damaged);
        Ok(damaged.len())
    }
}

impl Write for Faulty {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let damaged = self.damaged(bytes);
        self.line.write_all(&damaged)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn lost_doubled_broken_and_cut_frames_change_no_action_and_no_budget() {
    let expected = flown_at_hand(60, 9);
    for nth in [3, 5, 7] {
        let (plant, served) = connected();
        let server = serving(patient_socket(served, LONG).unwrap(), LONG);
        let mut client = Client::new(Faulty { line: patient_socket(plant, ENOUGH).unwrap(), nth, frames: 0 });
        assert_eq!(flown_over(&mut client, 60, 9), expected, "every {nth}th frame");
        drop(client);
        assert!(server.join().unwrap().unwrap() >= 60);
    }
}

#[test]
fn a_plant_that_falls_silent_is_let_go() {
    let (plant, served) = connected();
    let server = serving(patient_socket(served, SHORT).unwrap(), SHORT);
    assert!(server.join().unwrap().unwrap_err().contains("asked nothing for"));
    drop(plant);
}

/// Never silent, and never a request.
#[test]
fn a_plant_that_only_makes_noise_is_let_go() {
    let (mut plant, served) = connected();
    let server = serving(patient_socket(served, LONG).unwrap(), SHORT);
    while !server.is_finished() {
        // The last of these meet a closed connection.
        let _ = plant.write_all(&[0, 7, 0]);
        thread::sleep(Duration::from_millis(1));
    }
    assert!(server.join().unwrap().unwrap_err().contains("asked nothing for"));
}

/// Asks and asks, and never reads an answer.
#[test]
fn a_plant_that_does_not_read_cannot_hold_the_controller() {
    let (answers, to_plant) = io::pipe().unwrap();
    let mut hello = [0; REQUEST_FRAME];
    let request = armor_infer::link::Request::<1>::Hello { version: 1 };
    let frame = armor_infer::link::encode(&request, &mut hello).unwrap().to_vec();
    let endless = io::Cursor::new(frame.repeat(100_000));
    let server = serving(PatientPipe::new(endless, to_plant, SHORT), LONG);
    assert!(server.join().unwrap().unwrap_err().contains("the line to the plant broke"));
    drop(answers);
}

#[test]
fn a_client_gives_up_on_a_controller_that_does_not_answer() {
    let (plant, mut served) = connected();
    let mut client = Client::new(patient_socket(plant, SHORT).unwrap());
    assert!(matches!(client.hello(), Err(ClientError::Silent)));
    drop(client);
    let mut received = Vec::new();
    served.read_to_end(&mut received).unwrap();
    let mut receiver = Receiver::<REQUEST_FRAME>::new();
    let hellos = received.iter().filter(|&&byte| {
        receiver.push(byte).is_some_and(|frame| decode::<armor_infer::link::Request<1>>(frame).is_ok())
    });
    assert_eq!(hellos.count(), 4);
}

#[test]
fn a_refusal_reaches_the_plant_in_words() {
    let (plant, served) = connected();
    let server = serving(patient_socket(served, LONG).unwrap(), LONG);
    let mut client = Client::new(patient_socket(plant, LONG).unwrap());
    assert!(client.step(&[0.0; 7], 0.0).unwrap_err().to_string().contains("say hello first"));
    client.hello().unwrap();
    let greedy = CostLimit::new(fixture::TRAINED_MAX + 1.0).unwrap().cost();
    assert!(client.reset(greedy, 0).unwrap_err().to_string().contains("ask for at most 40"));
    assert_eq!(client.reset(limit(), 0).unwrap(), limit());
    drop(client);
    server.join().unwrap().unwrap();
}
