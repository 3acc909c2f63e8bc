//! Which WMS is spoken.

use crate::http::query::Parameters;

/// A version of the standard that this server speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// 1.1.1 (and 1.1.0, whose requests mean the same).
    V1_1_1,
    /// 1.3.0.
    V1_3_0,
}

impl Version {
    /// The version of a GetMap or GetFeatureInfo request, negotiated as for the capabilities (1.1.0 means 1.1.1, and
    /// so on). Where it says none, the parameter that only one version has decides (CRS or SRS), else 1.3.0. An
    /// error: what is no version.
    pub fn of_request(parameters: &Parameters) -> Result<Self, ()> {
        match parameters.get("VERSION").or_else(|| parameters.get("WMTVER")) {
            Some(asked) if asked.split('.').all(|part| part.parse::<u32>().is_ok()) => {
                Ok(Self::negotiated(asked))
            }
            Some(_) => Err(()),
            None if parameters.has("SRS") && !parameters.has("CRS") => Ok(Self::V1_1_1),
            None => Ok(Self::V1_3_0),
        }
    }

    /// The version of the capabilities document, as the standard's negotiation has it: the version
    /// asked for, else the next lower one spoken, else the lowest; none asked for: the highest.
    pub fn of_capabilities(parameters: &Parameters) -> Self {
        let asked = parameters.get("VERSION").or_else(|| parameters.get("WMTVER"));
        asked.map_or(Self::V1_3_0, Self::negotiated)
    }

    fn negotiated(asked: &str) -> Self {
        let mut numbers = asked.split('.').map(|part| part.parse::<u32>().unwrap_or(0));
        let asked = (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0), numbers.next().unwrap_or(0));
        if asked >= (1, 3, 0) { Self::V1_3_0 } else { Self::V1_1_1 }
    }

    /// Name of the parameter that holds the reference system.
    pub fn reference_system_name(self) -> &'static str {
        match self {
            Self::V1_1_1 => "SRS",
            Self::V1_3_0 => "CRS",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn negotiation() {
        let of = |query: &str| Version::of_capabilities(&Parameters::parse(query).unwrap());
        assert_eq!(of(""), Version::V1_3_0);
        assert_eq!(of("VERSION=1.3.0"), Version::V1_3_0);
        assert_eq!(of("VERSION=2.0"), Version::V1_3_0);
        assert_eq!(of("VERSION=1.2.0"), Version::V1_1_1);
        assert_eq!(of("VERSION=1.1.1"), Version::V1_1_1);
        assert_eq!(of("VERSION=1.0.0"), Version::V1_1_1);
    }

    #[test]
    fn a_request_without_version_is_understood_by_its_parameters() {
        let of = |query: &str| Version::of_request(&Parameters::parse(query).unwrap());
        assert_eq!(of("SRS=EPSG:4326"), Ok(Version::V1_1_1));
        assert_eq!(of("CRS=EPSG:4326"), Ok(Version::V1_3_0));
        assert_eq!(of("VERSION=1.3&SRS=EPSG:4326"), Ok(Version::V1_3_0));
        assert_eq!(of("VERSION=1.2.3"), Ok(Version::V1_1_1));
        assert_eq!(of("VERSION=1.1.0"), Ok(Version::V1_1_1));
        assert_eq!(of("VERSION=2"), Ok(Version::V1_3_0));
        assert_eq!(of("VERSION=latest"), Err(()));
    }
}
