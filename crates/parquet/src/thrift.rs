//! The compact protocol of Thrift, in which Parquet writes its headers: only what those need, written and read.

/// Types of fields and of items of a list.
const TRUE: u8 = 1;
const FALSE: u8 = 2;
const BYTE: u8 = 3;
const I16: u8 = 4;
pub const I32: u8 = 5;
pub const I64: u8 = 6;
const NUMBER: u8 = 7;
pub const BINARY: u8 = 8;
pub const LIST: u8 = 9;
const SET: u8 = 10;
pub const STRUCT: u8 = 12;

/// A struct that is being written; its fields come in the order of their numbers.
pub struct Struct<'a> {
    out: &'a mut Vec<u8>,
    last: u8,
}

impl<'a> Struct<'a> {
    /// Writes a struct and its end.
    pub fn write(out: &'a mut Vec<u8>, fields: impl FnOnce(&mut Struct<'_>)) {
        let mut own = Struct { out, last: 0 };
        fields(&mut own);
        own.out.push(0);
    }

    fn field(&mut self, number: u8, kind: u8) {
        debug_assert!(number > self.last && number - self.last < 16, "fields come in order");
        self.out.push((number - self.last) << 4 | kind);
        self.last = number;
    }

    pub fn int(&mut self, number: u8, value: i32) {
        self.field(number, I32);
        varint(self.out, zigzag(value.into()));
    }

    pub fn long(&mut self, number: u8, value: usize) {
        self.field(number, I64);
        varint(self.out, zigzag(value as i64));
    }

    pub fn yes(&mut self, number: u8) {
        self.field(number, TRUE);
    }

    pub fn binary(&mut self, number: u8, value: &[u8]) {
        self.field(number, BINARY);
        bytes(self.out, value);
    }

    pub fn inner(&mut self, number: u8, fields: impl FnOnce(&mut Struct<'_>)) {
        self.field(number, STRUCT);
        Struct::write(self.out, fields);
    }

    pub fn ints(&mut self, number: u8, values: &[i32]) {
        self.list(number, I32, values.len());
        for value in values {
            varint(self.out, zigzag((*value).into()));
        }
    }

    pub fn texts(&mut self, number: u8, values: &[&str]) {
        self.list(number, BINARY, values.len());
        for value in values {
            bytes(self.out, value.as_bytes());
        }
    }

    pub fn structs<T>(&mut self, number: u8, items: &[T], mut fields: impl FnMut(&mut Struct<'_>, &T)) {
        self.list(number, STRUCT, items.len());
        for item in items {
            Struct::write(self.out, |one| fields(one, item));
        }
    }

    fn list(&mut self, number: u8, kind: u8, length: usize) {
        self.field(number, LIST);
        if length < 15 {
            self.out.push((length as u8) << 4 | kind);
        } else {
            self.out.push(0xF0 | kind);
            varint(self.out, length as u64);
        }
    }
}

fn bytes(out: &mut Vec<u8>, value: &[u8]) {
    varint(out, value.len() as u64);
    out.extend_from_slice(value);
}

fn zigzag(value: i64) -> u64 {
    (value << 1 ^ value >> 63) as u64
}

/// Seven bits in each byte, the lowest first.
fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Structs and lists within others that are read.
const DEEPEST: u32 = 16;

/// A struct that is being read. What is asked for is none where the bytes are not those of one.
pub struct Fields<'a> {
    bytes: &'a [u8],
    depth: u32,
}

impl<'a> Fields<'a> {
    /// That at the beginning of some bytes.
    pub fn of(bytes: &'a [u8]) -> Self {
        Fields { bytes, depth: 0 }
    }

    /// How many bytes are left.
    pub fn left(&self) -> usize {
        self.bytes.len()
    }

    /// Calls with the number and the type of each field, whose value is then read or skipped.
    pub fn each(&mut self, mut field: impl FnMut(i64, u8, &mut Self) -> Option<()>) -> Option<()> {
        let mut number = 0_i64;
        self.within(|own| {
            loop {
                let head = own.byte()?;
                if head == 0 {
                    return Some(());
                }
                let step = i64::from(head >> 4);
                number = if step == 0 { own.int()? } else { number.checked_add(step)? };
                field(number, head & 0x0F, own)?;
            }
        })
    }

    /// Reads what lies one level deeper.
    fn within(&mut self, read: impl FnOnce(&mut Self) -> Option<()>) -> Option<()> {
        self.depth = (self.depth < DEEPEST).then_some(self.depth + 1)?;
        read(self)?;
        self.depth -= 1;
        Some(())
    }

    /// Calls for each item of a list.
    pub fn items(&mut self, mut item: impl FnMut(&mut Self) -> Option<()>) -> Option<()> {
        let (_, length) = self.list()?;
        (0..length).try_for_each(|_| item(self))
    }

    /// A whole number.
    pub fn int(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// Bytes of a text.
    pub fn binary(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.varint()?).ok()?;
        let (own, rest) = self.bytes.split_at_checked(length)?;
        self.bytes = rest;
        Some(own)
    }

    /// Goes on behind a value of this type.
    pub fn skip(&mut self, kind: u8) -> Option<()> {
        match kind {
            TRUE | FALSE => Some(()),
            BYTE => self.byte().map(drop),
            I16 | I32 | I64 => self.varint().map(drop),
            NUMBER => self.bytes.split_off(..size_of::<f64>()).map(drop),
            BINARY => self.binary().map(drop),
            LIST | SET => {
                let (kind, length) = self.list()?;
                (0..length)
                    .try_for_each(|_| if kind <= FALSE { self.byte().map(drop) } else { self.skip(kind) })
            }
            STRUCT => self.each(|_, kind, from| from.skip(kind)),
            _ => None,
        }
    }

    /// The type of its items and how many there are; each takes a byte at least.
    fn list(&mut self) -> Option<(u8, usize)> {
        let head = self.byte()?;
        let short = usize::from(head >> 4);
        let length = if short == 15 { usize::try_from(self.varint()?).ok()? } else { short };
        (length <= self.bytes.len()).then_some((head & 0x0F, length))
    }

    fn byte(&mut self) -> Option<u8> {
        self.bytes.split_off_first().copied()
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }
}
