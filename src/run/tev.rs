//! The protocol of tev, a viewer of images, over TCP: the packets as bytes, and a connection that sends them.
//!
//! The format follows the source of tev (github.com/Tom94/tev: `IpcPacket` in `include/tev/Ipc.h` at
//! 029022e, `src/Ipc.cpp` at 61253bf, `src/main.cpp` at 009e7c1). A packet consists of its length in bytes
//! (u32, including these four), a type (i8) and the fields of that type. Integers are little-endian, a
//! boolean is one byte, a text ends with a zero byte, and pixels are f32.

use std::fmt;
use std::io::{self, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::str::FromStr;
use std::time::Duration;

/// An empty image under a name; one of that name goes.
const CREATE_IMAGE: u8 = 4;
/// Values of some channels in a rectangle, each channel with its own offset and stride.
const UPDATE_IMAGE_V3: u8 = 6;

/// Values in a packet at most: with its head it stays below the 1 MiB that tev's buffer holds at first.
const MOST_VALUES: usize = 1 << 17;

/// How long nothing may be taken before the viewer counts as hanging.
const PATIENCE: Duration = Duration::from_secs(3);

/// Where a viewer listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Address {
    host: String,
    port: u16,
}

impl Address {
    /// Where tev listens unless it is told otherwise.
    pub(crate) const USUAL: &str = "127.0.0.1:14158";
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Address, String> {
        let parts = text.rsplit_once(':').and_then(|(host, port)| {
            let host = host.strip_prefix('[').and_then(|h| h.strip_suffix(']')).unwrap_or(host);
            Some((host, port.parse().ok().filter(|port| *port != 0)?))
        });
        match parts {
            Some((host, port)) if !host.is_empty() && !host.contains(['[', ']', '/']) => {
                Ok(Address { host: host.into(), port })
            }
            _ => Err(format!("HOST:PORT is needed, as {}; files come before --tev", Address::USUAL)),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.host {
            host if host.contains(':') => write!(f, "[{host}]:{}", self.port),
            host => write!(f, "{host}:{}", self.port),
        }
    }
}

/// An image as a viewer shows it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TevImage {
    /// Under which it is shown.
    pub name: String,
    /// Pixels per row.
    pub width: usize,
    /// Rows, from the top.
    pub height: usize,
    /// Names and values, row by row.
    pub channels: Vec<(String, Vec<f32>)>,
}

impl TevImage {
    /// Has the viewer show an empty image of this name, size and channels; `is_focus` selects it there.
    pub(crate) fn create(&self, is_focus: bool) -> Vec<u8> {
        let mut packet = Packet::new(CREATE_IMAGE, is_focus, &self.name);
        packet.integers(&[self.width, self.height, self.channels.len()]);
        self.channels.iter().for_each(|(name, _)| packet.text(name));
        packet.sealed()
    }

    /// Fills that image, part by part.
    pub(crate) fn updates(&self) -> impl Iterator<Item = Vec<u8>> + '_ {
        let columns = self.width.clamp(1, MOST_VALUES);
        let channels = (MOST_VALUES / columns).min(self.channels.len()).max(1);
        let rows = (MOST_VALUES / (columns * channels)).min(self.height).max(1);
        let parts = self.channels.chunks(channels).flat_map(move |chunk| {
            let rows = (0..self.height).step_by(rows).map(move |y| (y, rows.min(self.height - y)));
            rows.map(move |rows| (chunk, rows))
        });
        parts.flat_map(move |(chunk, rows)| {
            let columns =
                (0..self.width).step_by(columns).map(move |x| (x, columns.min(self.width - x)));
            columns.map(move |columns| self.update(chunk, columns, rows))
        })
    }

    /// Fills a rectangle, given as first and number of columns and rows: one channel after the other.
    fn update(
        &self,
        channels: &[(String, Vec<f32>)],
        (x, w): (usize, usize),
        (y, h): (usize, usize),
    ) -> Vec<u8> {
        let mut packet = Packet::new(UPDATE_IMAGE_V3, false, &self.name);
        packet.integers(&[channels.len()]);
        channels.iter().for_each(|(name, _)| packet.text(name));
        packet.integers(&[x, y, w, h]);
        (0..channels.len()).for_each(|index| packet.long_integer(index * w * h));
        channels.iter().for_each(|_| packet.long_integer(1));
        for (_, values) in channels {
            for row in values.chunks(self.width).skip(y).take(h) {
                row[x..x + w].iter().for_each(|value| packet.0.extend(value.to_le_bytes()));
            }
        }
        packet.sealed()
    }
}

/// A packet that is being written.
struct Packet(Vec<u8>);

impl Packet {
    fn new(kind: u8, is_focus: bool, image: &str) -> Packet {
        let mut packet = Packet(vec![0, 0, 0, 0, kind, u8::from(is_focus)]);
        packet.text(image);
        packet
    }

    /// A zero byte would end the text early, and what follows would be read as something else.
    fn text(&mut self, text: &str) {
        self.0.extend(text.replace('\0', "\u{fffd}").bytes());
        self.0.push(0);
    }

    /// Sizes of images stay far below 2^31: a record holds an f64 for each pixel.
    fn integers(&mut self, values: &[usize]) {
        values.iter().for_each(|&value| self.0.extend((value as i32).to_le_bytes()));
    }

    fn long_integer(&mut self, value: usize) {
        self.0.extend((value as i64).to_le_bytes());
    }

    fn sealed(mut self) -> Vec<u8> {
        let length = self.0.len() as u32;
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

/// An open connection to a viewer.
#[derive(Debug)]
pub(crate) struct Connection(TcpStream);

impl Connection {
    /// Connects to a viewer.
    ///
    /// # Errors
    /// No program listens at the address, or none answers.
    pub(crate) fn open(address: &Address) -> io::Result<Connection> {
        let mut last = io::Error::new(io::ErrorKind::NotFound, "the host has no address");
        for socket in (address.host.as_str(), address.port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&socket, PATIENCE) {
                Ok(stream) => {
                    stream.set_write_timeout(Some(PATIENCE))?;
                    stream.set_nodelay(true)?;
                    return Ok(Connection(stream));
                }
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    /// Sends a packet.
    ///
    /// # Errors
    /// The viewer has closed the connection, or has taken nothing for some seconds.
    pub(crate) fn send(&mut self, packet: &[u8]) -> io::Result<()> {
        self.check()?;
        self.0.write_all(packet).map_err(|error| match error.kind() {
            io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => {
                io::Error::other(format!("it took nothing for {} s", PATIENCE.as_secs()))
            }
            _ => error,
        })
    }

    /// What is written after the viewer has gone is lost silently, at first; that it has gone can
    /// be read.
    ///
    /// # Errors
    /// It has gone.
    pub(crate) fn check(&self) -> io::Result<()> {
        self.0.set_nonblocking(true)?;
        let peeked = self.0.peek(&mut [0]);
        self.0.set_nonblocking(false)?;
        match peeked {
            Ok(0) => Err(io::Error::other("it closed the connection")),
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => Err(error),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(width: usize, height: usize, channels: usize) -> TevImage {
        let values = |c: usize| (0..width * height).map(|i| (c * 1000 + i) as f32).collect();
        let channels = (0..channels).map(|c| (format!("c{c}"), values(c))).collect();
        TevImage { name: "a/b".into(), width, height, channels }
    }

    // Written out by hand from tev's `setCreateImage`.
    #[test]
    fn a_new_image() {
        let mut expected = vec![28, 0, 0, 0, 4, 1];
        expected.extend(b"a/b\0");
        expected.extend([3, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0]);
        expected.extend(b"c0\0c1\0");
        assert_eq!(frame(3, 2, 2).create(true), expected);
        assert_eq!(frame(3, 2, 2).create(false)[5], 0);
    }

    // Written out by hand from tev's `setUpdateImage`: 0, 1, 1000 and 1001 as f32.
    #[test]
    fn its_pixels() {
        let mut expected = vec![84, 0, 0, 0, 6, 0];
        expected.extend(b"a/b\0");
        expected.extend([2, 0, 0, 0]);
        expected.extend(b"c0\0c1\0");
        expected.extend([0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0]);
        expected.extend([0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0]);
        expected.extend([1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]);
        expected.extend([0, 0, 0, 0, 0, 0, 0x80, 0x3f, 0, 0, 0x7a, 0x44, 0, 0x40, 0x7a, 0x44]);
        assert_eq!(frame(2, 1, 2).updates().collect::<Vec<_>>(), [expected]);
    }

    #[test]
    fn a_zero_byte_ends_no_name_early() {
        let mut frame = frame(1, 1, 1);
        frame.name = "a\0b".into();
        assert_eq!(frame.create(false)[6..12], *"a\u{fffd}b\0".as_bytes());
    }

    // Wide, tall, deep, and wider than a packet: every pixel of every channel once, in small packets.
    #[test]
    fn parts_are_small_and_cover_the_image() {
        for (width, height, channels) in [(700, 300, 9), (3, 50_000, 5), (2000, 3, 160), (140_000, 2, 2)]
        {
            let frame = frame(width, height, channels);
            let packets: Vec<Vec<u8>> = frame.updates().collect();
            assert!(packets.iter().all(|packet| packet.len() < 1_000_000));
            let values: usize = packets.iter().map(|packet| values(packet)).sum();
            assert_eq!(values, width * height * channels);
        }
    }

    /// Number of values behind the heads of an update's channels.
    fn values(packet: &[u8]) -> usize {
        let at = |i: usize| i32::from_le_bytes([0, 1, 2, 3].map(|k| packet[i + k])) as usize;
        let count = at(10);
        let names: usize = packet[14..].split(|b| *b == 0).take(count).map(|name| name.len() + 1).sum();
        let head = 14 + names + 16 + 16 * count;
        assert_eq!(packet.len(), head + 4 * count * at(14 + names + 8) * at(14 + names + 12));
        (packet.len() - head) / 4
    }

    #[test]
    fn addresses() {
        for text in ["127.0.0.1:14158", "[::1]:80", "host.example:65535"] {
            assert_eq!(text.parse::<Address>().map(|a| a.to_string()), Ok(text.to_string()));
        }
        for text in ["", "host", ":1", "host:", "host:0", "host:70000", "[]:1", "x.toml", "a/b.toml:3"] {
            let refused = text.parse::<Address>().expect_err(text);
            assert!(refused.contains("HOST:PORT is needed, as 127.0.0.1:14158"), "{refused}");
        }
    }
}
