//! Hardware in the loop: a plant has the UART of an emulated controller.

use std::io;
use std::net::{Shutdown, TcpListener, TcpStream};
use std::thread;

use super::emulator::Flashed;
use super::episode::connection;
use super::error::McuError;

/// Waits for a plant, starts the controller, and passes bytes between both
/// until one of them leaves.
///
/// # Errors
/// [`McuError`]
pub fn bridge(flashed: &Flashed<'_>, max_steps: u32, plants: &TcpListener) -> Result<(), McuError> {
    let line = || McuError::system("pass bytes between", "plant and emulator".as_ref());
    let serial = TcpListener::bind("127.0.0.1:0").map_err(line())?;
    let address = serial.local_addr().map_err(line())?;
    let (plant, _) = plants.accept().map_err(line())?;
    let mut running = flashed.start(&format!("serve {max_steps} 0"), &["-serial".into(), format!("tcp:{address}")])?;
    let Some(uart) = connection(&mut running, &serial)? else {
        return running.wait(super::episode::START).map(|_| ());
    };
    thread::scope(|scope| {
        let there = scope.spawn(|| pass(&plant, &uart));
        let back = pass(&uart, &plant);
        there.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)).and(back)
    })
    .map_err(line())
}

/// Passes bytes on until there are no more, and ends the line for both sides.
fn pass(mut from: &TcpStream, mut to: &TcpStream) -> io::Result<()> {
    from.set_nodelay(true)?;
    let passed = io::copy(&mut from, &mut to);
    for side in [from, to] {
        // It may be closed already.
        let _ = side.shutdown(Shutdown::Both);
    }
    match passed {
        Err(error) if error.kind() != io::ErrorKind::ConnectionReset => Err(error),
        _ => Ok(()),
    }
}
