//! A serialiser that writes nothing: it walks a value and stops at the first number that JSON
//! cannot hold. `serde_json` turns NaN into `null`, which a reader takes for "not measured".

use std::fmt::{self, Display};

use serde::Serialize;
use serde::ser::{self, Serializer};

/// Place (`curve.points[3][0]`) and value of the first NaN or infinity in `value`.
pub(crate) fn first_non_finite(
    value: &(impl Serialize + ?Sized),
) -> Result<Option<(String, f64)>, String> {
    match value.serialize(&mut Walk { place: Vec::new() }) {
        Ok(()) => Ok(None),
        Err(Stop::NotFinite(place, value)) => Ok(Some((place, value))),
        Err(Stop::Custom(message)) => Err(message),
    }
}

#[derive(Debug)]
enum Stop {
    NotFinite(String, f64),
    Custom(String),
}

impl Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite(place, value) => write!(f, "{place} is {value}"),
            Self::Custom(message) => f.write_str(message),
        }
    }
}

impl std::error::Error for Stop {}

impl ser::Error for Stop {
    fn custom<T: Display>(message: T) -> Self {
        Self::Custom(message.to_string())
    }
}

enum Step {
    Key(String),
    Index(usize),
}

struct Walk {
    place: Vec<Step>,
}

impl Walk {
    fn number(&self, value: f64) -> Result<(), Stop> {
        if value.is_finite() { Ok(()) } else { Err(Stop::NotFinite(self.place(), value)) }
    }

    fn place(&self) -> String {
        let mut text = String::new();
        for step in &self.place {
            match step {
                Step::Key(key) if text.is_empty() => text.push_str(key),
                Step::Key(key) => text = format!("{text}.{key}"),
                Step::Index(index) => text = format!("{text}[{index}]"),
            }
        }
        if text.is_empty() { "the value".to_owned() } else { text }
    }

    fn enter(&mut self, step: Step, value: &(impl Serialize + ?Sized)) -> Result<(), Stop> {
        self.place.push(step);
        value.serialize(&mut *self)?;
        self.place.pop();
        Ok(())
    }
}

/// A sequence or map being walked.
struct Inside<'w> {
    walk: &'w mut Walk,
    index: usize,
    key: String,
}

impl<'w> Inside<'w> {
    fn new(walk: &'w mut Walk) -> Result<Self, Stop> {
        Ok(Self { walk, index: 0, key: String::new() })
    }

    fn item(&mut self, value: &(impl Serialize + ?Sized)) -> Result<(), Stop> {
        let index = self.index;
        self.index += 1;
        self.walk.enter(Step::Index(index), value)
    }
}

macro_rules! nothing_to_check {
    ($($method:ident: $type:ty),*) => {
        $(fn $method(self, _: $type) -> Result<(), Stop> { Ok(()) })*
    };
}

impl<'w> Serializer for &'w mut Walk {
    type Ok = ();
    type Error = Stop;
    type SerializeSeq = Inside<'w>;
    type SerializeTuple = Inside<'w>;
    type SerializeTupleStruct = Inside<'w>;
    type SerializeTupleVariant = Inside<'w>;
    type SerializeMap = Inside<'w>;
    type SerializeStruct = Inside<'w>;
    type SerializeStructVariant = Inside<'w>;

    nothing_to_check!(
        serialize_bool: bool, serialize_char: char, serialize_str: &str, serialize_bytes: &[u8],
        serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64,
        serialize_unit_struct: &'static str
    );

    fn serialize_f32(self, value: f32) -> Result<(), Stop> {
        self.number(f64::from(value))
    }

    fn serialize_f64(self, value: f64) -> Result<(), Stop> {
        self.number(value)
    }

    fn serialize_none(self) -> Result<(), Stop> {
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), Stop> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<(), Stop> {
        Ok(())
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, _: &'static str) -> Result<(), Stop> {
        Ok(())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), Stop> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<(), Stop> {
        self.enter(Step::Key(variant.to_owned()), value)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Inside<'w>, Stop> {
        Inside::new(self)
    }

    fn serialize_tuple(self, _: usize) -> Result<Inside<'w>, Stop> {
        Inside::new(self)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Inside<'w>, Stop> {
        Inside::new(self)
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Inside<'w>, Stop> {
        Inside::new(self)
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Inside<'w>, Stop> {
        Inside::new(self)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Inside<'w>, Stop> {
        Inside::new(self)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Inside<'w>, Stop> {
        Inside::new(self)
    }
}

macro_rules! walk_items {
    ($($trait:ident, $method:ident);*) => {$(
        impl ser::$trait for Inside<'_> {
            type Ok = ();
            type Error = Stop;
            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Stop> {
                self.item(value)
            }
            fn end(self) -> Result<(), Stop> {
                Ok(())
            }
        }
    )*};
}

walk_items!(
    SerializeSeq, serialize_element;
    SerializeTuple, serialize_element;
    SerializeTupleStruct, serialize_field;
    SerializeTupleVariant, serialize_field
);

macro_rules! walk_fields {
    ($($trait:ident),*) => {$(
        impl ser::$trait for Inside<'_> {
            type Ok = ();
            type Error = Stop;
            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                key: &'static str,
                value: &T,
            ) -> Result<(), Stop> {
                self.walk.enter(Step::Key(key.to_owned()), value)
            }
            fn end(self) -> Result<(), Stop> {
                Ok(())
            }
        }
    )*};
}

walk_fields!(SerializeStruct, SerializeStructVariant);

impl ser::SerializeMap for Inside<'_> {
    type Ok = ();
    type Error = Stop;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), Stop> {
        self.key = match serde_json::to_value(key) {
            Ok(serde_json::Value::String(text)) => text,
            Ok(other) => other.to_string(),
            Err(e) => return Err(Stop::Custom(e.to_string())),
        };
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Stop> {
        let key = std::mem::take(&mut self.key);
        self.walk.enter(Step::Key(key), value)
    }

    fn end(self) -> Result<(), Stop> {
        Ok(())
    }
}
