//! Names of the variables of a circuit in a written form, such as a drive file.

/// Short names of the variables of a circuit.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Component whose name is left out: "cylinder.position_m" is called "position_m".
    pub of: String,
    /// Short and full names in the order of inputs, columns and starts; other variables follow them.
    pub table: Vec<(String, String)>,
    /// Whether columns without a short name are left out.
    pub only: bool,
}

/// Ports that the edges of a proportional 5/3 valve connect, in the order of the inputs of the valve.
pub(super) const EDGES: [(&str, &str); 4] = [
    ("opening_1_4", "opening of the edge from supply to chamber a"),
    ("opening_4_5", "opening of the edge from chamber a to exhaust"),
    ("opening_1_2", "opening of the edge from supply to chamber b"),
    ("opening_2_3", "opening of the edge from chamber b to exhaust"),
];

impl Names {
    pub(super) fn place(&self, full: &str) -> Option<usize> {
        self.table.iter().position(|(_, own)| own == full)
    }

    fn within<'a>(&self, full: &'a str) -> Option<&'a str> {
        full.strip_prefix(&self.of).and_then(|rest| rest.strip_prefix('.'))
    }

    /// Returns the name that users see.
    pub(super) fn short(&self, full: &str) -> String {
        match self.place(full) {
            Some(place) => self.table[place].0.clone(),
            None => self.within(full).unwrap_or(full).into(),
        }
    }

    /// Returns the sort key of a variable: first variables of the table, then those of the component, then all others.
    pub(super) fn rank(&self, full: &str) -> usize {
        self.place(full).unwrap_or(self.table.len() + usize::from(self.within(full).is_none()))
    }

    /// Returns the name that users see for a number of a component; without a table, its key.
    pub(super) fn key(&self, of: &str, key: &str) -> String {
        let place = self.place(&format!("{of}.{key}"));
        place.map_or(key.into(), |place| self.table[place].0.clone())
    }

    /// Returns a message about a component, with its name in front unless the name is left out.
    pub(super) fn said(&self, of: &str, message: &str) -> String {
        if of == self.of { message.into() } else { format!("{of}: {message}") }
    }
}
