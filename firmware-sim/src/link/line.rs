//! Streams that do not wait for ever: a read or write that takes longer than
//! its patience fails with [`ErrorKind::TimedOut`] or [`ErrorKind::WouldBlock`].

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

/// Bytes that a pipe hands over at once.
const CHUNK: usize = 4096;

/// Gives a connection its patience, and sends each frame at once.
///
/// # Errors
/// Where the system refuses, as for a patience of 0.
pub fn patient_socket(socket: TcpStream, patience: Duration) -> io::Result<TcpStream> {
    socket.set_nodelay(true)?;
    socket.set_read_timeout(Some(patience))?;
    socket.set_write_timeout(Some(patience))?;
    Ok(socket)
}

/// Two pipes, such as a process's standard streams, with patience.
///
/// A pipe knows no time-outs, so a thread of its own waits on each; where the
/// peer never moves, these threads stay behind until the process ends.
#[derive(Debug)]
pub struct PatientPipe {
    patience: Duration,
    incoming: Receiver<Vec<u8>>,
    /// What came and was not read yet.
    rest: Vec<u8>,
    outgoing: SyncSender<Vec<u8>>,
    written: Receiver<io::Result<()>>,
}

impl PatientPipe {
    /// A line that reads from one pipe and writes to the other.
    pub fn new(
        mut reader: impl Read + Send + 'static,
        mut writer: impl Write + Send + 'static,
        patience: Duration,
    ) -> Self {
        let (arrived, incoming) = sync_channel(1);
        thread::spawn(move || {
            let mut chunk = [0; CHUNK];
            // An error ends the line as its end does.
            while let Ok(length @ 1..) = reader.read(&mut chunk) {
                if arrived.send(chunk[..length].to_vec()).is_err() {
                    return;
                }
            }
        });
        let (outgoing, to_write) = sync_channel::<Vec<u8>>(1);
        let (done, written) = sync_channel(1);
        thread::spawn(move || {
            for bytes in to_write {
                if done.send(writer.write_all(&bytes).and_then(|()| writer.flush())).is_err() {
                    return;
                }
            }
        });
        Self { patience, incoming, rest: Vec::new(), outgoing, written }
    }
}

impl Read for PatientPipe {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.rest.is_empty() {
            match self.incoming.recv_timeout(self.patience) {
                Ok(bytes) => self.rest = bytes,
                Err(RecvTimeoutError::Timeout) => return Err(ErrorKind::TimedOut.into()),
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
            }
        }
        let length = buffer.len().min(self.rest.len());
        buffer[..length].copy_from_slice(&self.rest[..length]);
        self.rest.drain(..length);
        Ok(length)
    }
}

impl Write for PatientPipe {
    /// Writes all of `bytes`; after a time-out the line is of no more use.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.outgoing.try_send(bytes.to_vec()).map_err(|_| ErrorKind::BrokenPipe)?;
        match self.written.recv_timeout(self.patience) {
            Ok(result) => result.map(|()| bytes.len()),
            Err(RecvTimeoutError::Timeout) => Err(ErrorKind::TimedOut.into()),
            Err(RecvTimeoutError::Disconnected) => Err(ErrorKind::BrokenPipe.into()),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
