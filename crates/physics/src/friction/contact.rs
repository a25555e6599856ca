use super::{
    AnyLaw, At, Direction, Dwell, Heating, InnerState, Levels, Position, Relaxation, SealLips, SideLoad,
    Wear,
    modifiers::{dwell, relaxation, temperature, wear},
};
use math::{Over, Real};

/// Defines [`Composition`] from the list of modifiers.
macro_rules! modifiers {
    ($(#[$attribute:meta])* pub struct $name:ident { $($(#[$about:meta])* $modifier:ident: $type:ident,)* }) => {
        $(#[$attribute])*
        #[derive(Clone, Debug)]
        pub struct $name<P> {
            $($(#[$about])* pub $modifier: Option<$type<P>>,)*
        }

        impl<P> $name<P> {
            /// No modifiers: the law alone.
            pub const NONE: Self = $name { $($modifier: None),* };

            fn is_none(&self) -> bool {
                $(self.$modifier.is_none())&&*
            }
        }

        math::gather!($name { $($modifier),* });

        #[allow(dead_code)] // some modifiers are needed in one place only
        impl<P: Real> Contact<P> {
            $(fn $modifier(&self) -> Option<&$type<P>> {
                self.composition.as_ref()?.$modifier.as_ref()
            })*
        }
    };
}

modifiers! {
    /// Friction modifiers in addition to seal lips. Each works with any law that allows it.
    ///
    /// Seal lips, position, direction, temperature and wear modify the levels Fc and Fs of the law in this order. They
    /// give the levels of the seals. The guide's side load and then the age of the contact are added.
    pub struct Composition {
        /// Dependence on the position along the stroke.
        position: Position,
        /// Dependence on the direction of motion.
        direction: Direction,
        /// Dependence on the temperature of the contact.
        heating: Heating,
        /// Run-in and wear.
        wear: Wear,
        /// Side load on the guide.
        side_load: SideLoad,
        /// Growth with the age of the contact.
        dwell: Dwell,
        /// Relaxation of the deflection.
        relaxation: Relaxation,
    }
}

/// The friction of a moving mass: a law and its modifiers. Its inner states are those of the law, then the relaxed
/// deflection, the age of the contact, its temperature rise, and the sliding distance.
#[derive(Clone, Debug)]
pub struct Contact<P> {
    /// The law that gives the force.
    pub law: AnyLaw<P>,
    /// Dependence on the pressures in the chambers.
    pub seal_lips: Option<SealLips<P>>,
    /// All other modifiers; boxed, because most contacts have none of them.
    pub composition: Option<Box<Composition<P>>>,
    /// One of the usual laws with at most seal lips: evaluated in line, see [`Contact::usual_force`].
    pub is_usual: bool,
}

impl<P: Real> From<AnyLaw<P>> for Contact<P> {
    fn from(law: AnyLaw<P>) -> Self {
        Contact::new(law, None, Composition::NONE)
    }
}

impl<P: Real> Contact<P> {
    /// Creates the law with `seal_lips` and modifiers.
    pub fn new(law: AnyLaw<P>, seal_lips: Option<SealLips<P>>, composition: Composition<P>) -> Self {
        let composition = (!composition.is_none()).then(|| Box::new(composition));
        Contact { is_usual: composition.is_none() && law.is_usual(), law, seal_lips, composition }
    }

    /// Returns whether steady friction depends only on the velocity.
    #[inline(always)]
    pub fn is_of_velocity(&self) -> bool {
        self.seal_lips.is_none() && self.composition.is_none() && !self.law.is_of_place()
    }

    /// Returns it with other numbers of the same law.
    #[must_use]
    pub fn with_law(&self, law: AnyLaw<P>) -> Self {
        Contact { law, seal_lips: self.seal_lips.clone(), composition: self.composition.clone(), ..*self }
    }
}

math::gather!(Contact { law, seal_lips, composition } same { is_usual });

/// Returns the names of the inner states of modifiers, for any law.
pub const COMPOSITION_STATES: [&str; 4] =
    [relaxation::STATE.name, dwell::STATE, temperature::STATE.name, wear::STATE.name];

impl<P: Real> Contact<P> {
    /// Returns the indices of age, temperature rise and sliding distance among the inner states, if present.
    #[inline(always)]
    fn places(&self) -> [usize; 3] {
        let age = self.law.states().len() + usize::from(self.relaxation().is_some());
        let warming = age + usize::from(self.dwell().is_some());
        [age, warming, warming + usize::from(self.heating().is_some())]
    }

    /// Returns the inner states, in their order.
    pub fn states(&self) -> Vec<InnerState> {
        let mut states = self.law.states().to_vec();
        states.extend(self.relaxation().map(|_| relaxation::STATE));
        states.extend(self.dwell().map(Dwell::state));
        states.extend(self.heating().map(|_| temperature::STATE));
        states.extend(self.wear().map(|_| wear::STATE));
        states
    }

    /// Returns the same in surroundings of this temperature, K.
    pub fn surrounded(mut self, ambient: P) -> Self {
        if let Some(heating) = self.composition.as_mut().and_then(|composition| composition.heating.as_mut())
        {
            heating.ambient = ambient;
        }
        self
    }

    /// Returns the index of the age of the contact among the inner states.
    pub fn age_index(&self) -> Option<usize> {
        self.dwell().map(|_| self.places()[0])
    }

    /// Returns the keys in references.bib of the law and its modifiers.
    pub fn sources(&self) -> Vec<&'static str> {
        let mut sources: Vec<&str> =
            Some(self.law.meta().source).filter(|key| !key.is_empty()).into_iter().collect();
        sources.extend(self.dwell().map(|dwell| dwell.growth.source()));
        sources.extend(self.relaxation().map(|_| "ferry1980"));
        sources
    }

    /// Returns the levels of the seals: those of the law, under pressure.
    #[inline(always)]
    fn seals<S: Over<P>>(&self, at: &At<S>) -> Levels<S> {
        self.law.levels().map(S::from).under(self.seal_lips.as_ref(), at)
    }

    /// [`Contact::force`] for a usual contact.
    #[inline(always)]
    pub fn usual_force<S: Over<P>>(&self, at: &At<S>, inner: &[S], rates: &mut [S], mode: P) -> S {
        self.law.usual_force(at, self.seal_lips.as_ref(), inner, rates, mode)
    }

    /// Returns the friction force, N, positive if it opposes v > 0, and the rates of the inner states.
    pub fn force<S: Over<P>>(&self, at: &At<S>, inner: &[S], rates: &mut [S], mode: P) -> S {
        let Some(composition) = &self.composition else {
            return self.law.force(at, &self.seals(at), inner, rates, mode);
        };
        let young = self.levels_but_age(at, inner, mode);
        let increment = self.increment(at, inner);
        let levels = young.plus(increment);
        let (n, [age, warming, slid]) = (self.law.states().len(), self.places());
        let seen = composition.relaxation.as_ref().map(|relaxation| [relaxation.seen(inner[0], inner[n])]);
        let force =
            self.law.force(at, &levels, seen.as_ref().map_or(&inner[..n], |s| s), &mut rates[..n], mode);
        let slip = self.law.slip(at.v, &rates[..n]);
        if let Some(dwell) = &composition.dwell {
            rates[age] = dwell.rate(inner[age], at.v, slip, increment / levels.breakaway);
        }
        if composition.wear.is_some() {
            rates[slid] = slip.abs();
        }
        if let Some(relaxation) = &composition.relaxation {
            [rates[0], rates[n]] = relaxation.rates(at, inner[0], inner[n], rates[0]);
        }
        if let Some(heating) = &composition.heating {
            rates[warming] = heating.rate(inner[warming], self.heat(at.v, force, inner, rates));
        }
        force
    }

    /// Returns the force that the age of the contact adds to Fc and Fs, N.
    #[inline(always)]
    fn increment<S: Over<P>>(&self, at: &At<S>, inner: &[S]) -> S {
        match (self.dwell(), inner.get(self.places()[0])) {
            (Some(dwell), Some(age)) => dwell.increment(at, *age),
            _ => S::zero(),
        }
    }

    /// Returns Fc and Fs with all modifiers.
    pub fn levels<S: Over<P>>(&self, at: &At<S>, inner: &[S], mode: P) -> Levels<S> {
        self.levels_but_age(at, inner, mode).plus(self.increment(at, inner))
    }

    /// Returns the same without age. Without inner states, the contact is at ambient temperature and at the start.
    fn levels_but_age<S: Over<P>>(&self, at: &At<S>, inner: &[S], mode: P) -> Levels<S> {
        let mut levels = self.seals(at);
        if let Some(composition) = &self.composition {
            if let Some(position) = &composition.position {
                levels = position.apply(&levels, at);
            }
            if let Some(direction) = &composition.direction {
                levels = direction.apply(&levels, at, mode);
            }
            let [_, warming, slid] = self.places();
            let state = |i: usize| inner.get(i).copied().unwrap_or(S::zero());
            if let Some(heating) = &composition.heating {
                levels = heating.apply(&levels, state(warming));
            }
            if let Some(wear) = &composition.wear {
                levels = wear.apply(&levels, state(slid));
            }
            if let Some(side_load) = &composition.side_load {
                levels = side_load.apply(&levels);
            }
        }
        levels
    }

    /// Returns a value that is positive while the mode of the law holds.
    pub fn event<S: Over<P>>(&self, at: &At<S>, inner: &[S], mode: P) -> S {
        let own = &inner[..self.law.states().len()];
        self.law.event(at, &self.levels(at, inner, mode), own, mode)
    }

    /// Returns the mode of a mass that starts at this velocity with these inner states.
    pub fn first_mode(&self, at: &At<P>, inner: &[P]) -> P {
        let way = P::select(at.v.lt(P::zero()), -P::one(), P::one());
        let levels = self.levels(at, inner, way);
        let slips = self.law.slips_at(at, &levels, &inner[..self.law.states().len()]);
        P::select(slips, way, P::zero())
    }

    /// Returns the mode after an event of `mode`. Changes the inner states that remember events.
    pub fn next_mode(&self, mode: P, at: &At<P>, inner: &mut [P]) -> P {
        // Arguments for the law in stick: the applied force decides the direction of motion.
        let levels = self.levels(at, inner, P::zero());
        self.law.next_mode(mode, at, &levels, &mut inner[..self.law.states().len()])
    }

    /// Returns the energy stored in the inner states, J.
    pub fn stored<S: Over<P>>(&self, inner: &[S]) -> S {
        let n = self.law.states().len();
        let of_all = self.law.stored(&inner[..n]);
        match self.relaxation() {
            Some(relaxation) => relaxation.mixed(of_all, self.law.stored(&[inner[0] - inner[n]])),
            None => of_all,
        }
    }

    /// Returns the heat, W, from the force and the rates that [`Contact::force`] gave.
    pub fn heat<S: Over<P>>(&self, v: S, force: S, inner: &[S], rates: &[S]) -> S {
        let n = self.law.states().len();
        let of_all = self.law.heat(v, force, &inner[..n], &rates[..n]);
        match self.relaxation() {
            Some(relaxation) => {
                let (springs, their_rate) = (inner[0] - inner[n], rates[0] - rates[n]);
                relaxation.mixed(of_all, self.law.heat(v, force, &[springs], &[their_rate]))
            }
            None => of_all,
        }
    }

    /// Returns steady sliding at `at.v` (after any transient), N, at ambient temperature and with the initial wear.
    /// Both change too slowly to be a transient.
    pub fn steady<S: Over<P>>(&self, at: &At<S>) -> S {
        let mode = P::select(at.v.lt(S::zero()), -P::one(), P::one());
        let mut levels = self.levels_but_age(at, &[], mode);
        if let Some(dwell) = self.dwell() {
            levels = levels.plus(dwell.increment(at, dwell.steady(at.v)));
        }
        self.law.steady_at(at, &levels)
    }
}

impl Contact<f64> {
    /// Returns warnings about this friction, for gauge pressures between zero and `gauge` Pa in either chamber and
    /// positions between 0 and `stroke` m.
    pub fn warnings(&self, gauge: f64, stroke: f64) -> Vec<String> {
        let pressed = self.seal_lips.is_some() || self.dwell().is_some();
        let corners: &[[f64; 2]] =
            if pressed { &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] } else { &[[0.0, 0.0]] };
        let ats: Vec<At<f64>> =
            corners.iter().map(|[a, b]| At::at_rest().pressed(a * gauge, b * gauge)).collect();
        let extremes = ats.iter().flat_map(|at| self.extremes(at, stroke));
        let of_law = extremes.into_iter().find_map(|levels| self.law.warning(&levels));
        let stated = self.law.meta().parameters.iter().any(|parameter| parameter.key == "breakaway");
        let inverted = ats.iter().map(|at| self.seals(at)).find(|l| stated && l.breakaway < l.coulomb);
        let inverted = inverted.map(|levels| {
            format!(
                "under supply pressure the breakaway force falls below the Coulomb force ({:.3} N, {:.3} N): \
                 friction.pressure.breakaway is usually not below friction.pressure.coulomb",
                levels.breakaway, levels.coulomb
            )
        });
        of_law.into_iter().chain(inverted).collect()
    }

    /// Returns the levels with the largest difference that this contact can have at these pressures.
    fn extremes(&self, at: &At<f64>, stroke: f64) -> Vec<Levels<f64>> {
        let seals = self.seals(at);
        let places = self.position().map_or([1.0, 1.0], |position| position.range(stroke));
        let ways = self.direction().map_or([1.0, 1.0], |way| [way.positive, way.negative]);
        let aged = self.dwell().map_or(0.0, |dwell| dwell.increment(at, dwell::LONGEST_STOP));
        let factors = places.into_iter().flat_map(|place| ways.map(|way| place * way));
        let rises: &[f64] = if self.heating().is_some() { &[0.0, temperature::HOTTEST] } else { &[0.0] };
        let slides: &[f64] = if self.wear().is_some() { &[0.0, wear::FARTHEST] } else { &[0.0] };
        let states = rises.iter().flat_map(|rise| slides.iter().map(move |slid| (*rise, *slid)));
        let states: Vec<(f64, f64)> = states.collect();
        let levels = factors.flat_map(|factor| states.iter().map(move |&(rise, slid)| (factor, rise, slid)));
        let levels = levels.map(|(factor, rise, slid)| {
            let levels = seals.times(factor);
            let levels = self.heating().map_or(levels, |heating| heating.apply(&levels, rise));
            let levels = self.wear().map_or(levels, |wear| wear.apply(&levels, slid));
            let levels = self.side_load().map_or(levels, |load| load.apply(&levels));
            Levels { breakaway: levels.breakaway + aged, ..levels }
        });
        levels.collect()
    }
}
