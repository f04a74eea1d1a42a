//! Which addresses the service may call: public ones, over TLS, unless who runs
//! it says otherwise.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use url::{Host, Url};

/// The longest address of a receiver.
const MAX_URL_BYTES: usize = 2048;

/// Which addresses may be called besides public ones over TLS.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OutboundPolicy {
    /// Hosts by name or address, without ports, that may have any address and be
    /// called without TLS.
    pub trusted_hosts: Vec<String>,
    /// Whether all may be called without TLS.
    pub allow_http: bool,
}

/// Why an address may not be called.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// It is no URL.
    #[error("it is no absolute URL of at most {MAX_URL_BYTES} bytes; give an https URL")]
    NotAUrl,
    /// It is of another scheme. Not quoted: what is no URL may begin with anything.
    #[error("its scheme is none that may be called; give an https URL")]
    Scheme,
    /// It has a user's name or password in it.
    #[error("it has a name or password before the host; leave them out")]
    Credentials,
    /// The host is at an address that is not everybody's.
    #[error("`{0}` is at an address that is not public")]
    NotPublic(String),
}

impl OutboundPolicy {
    /// Reads a URL that may be called, as far as can be told without asking for
    /// the addresses of its host: that is done when it is called.
    ///
    /// # Errors
    /// [`Refused`], with what to mend.
    pub fn check(&self, text: &str) -> Result<Url, Refused> {
        if text.len() > MAX_URL_BYTES {
            return Err(Refused::NotAUrl);
        }
        let mut url = Url::parse(text).map_err(|_| Refused::NotAUrl)?;
        let name = url.host_str().unwrap_or_default().to_owned();
        match url.scheme() {
            "https" => {}
            "http" if self.allow_http || self.trusts(&name) => {}
            _ => return Err(Refused::Scheme),
        }
        if !url.username().is_empty() || url.password().is_some() {
            return Err(Refused::Credentials);
        }
        // Texts such as `0x7f.1` are addresses by now.
        let address = match url.host() {
            Some(Host::Ipv4(ip)) => Some(IpAddr::V4(ip)),
            Some(Host::Ipv6(ip)) => Some(IpAddr::V6(ip)),
            Some(Host::Domain(_)) => None,
            None => return Err(Refused::NotAUrl),
        };
        if address.is_some_and(|ip| !is_public(ip)) && !self.trusts(&name) {
            return Err(Refused::NotPublic(name));
        }
        url.set_fragment(None);
        Ok(url)
    }

    /// Lets the addresses of a host through if all of them may be called: one
    /// that is not public speaks against the whole name.
    pub(super) fn check_addresses(
        &self,
        host: &str,
        addresses: Vec<SocketAddr>,
    ) -> Result<Vec<SocketAddr>, Refused> {
        if self.trusts(host) || addresses.iter().all(|address| is_public(address.ip())) {
            return Ok(addresses);
        }
        Err(Refused::NotPublic(host.to_owned()))
    }

    fn trusts(&self, host: &str) -> bool {
        let plain = |text: &str| text.trim_matches(['[', ']']).to_ascii_lowercase();
        self.trusted_hosts.iter().any(|trusted| plain(trusted) == plain(host))
    }
}

/// Whether the address is one of the public internet, after the IANA registries
/// of special-purpose addresses.
fn is_public(ip: IpAddr) -> bool {
    match ip {
        IpAddr::V4(ip) => is_public_v4(ip),
        IpAddr::V6(ip) => is_public_v6(ip),
    }
}

fn is_public_v4(ip: Ipv4Addr) -> bool {
    let [a, b, c, _] = ip.octets();
    let is_special = ip.is_loopback()
        || ip.is_private()
        || ip.is_link_local()
        || ip.is_documentation()
        || ip.is_multicast()
        || a == 0
        // Shared by carriers, 100.64.0.0/10.
        || (a == 100 && b & 0xc0 == 64)
        // Protocol assignments, and relays of 6to4.
        || (a == 192 && b == 0 && c == 0)
        || (a == 192 && b == 88 && c == 99)
        // Measurements, 198.18.0.0/15.
        || (a == 198 && b & 0xfe == 18)
        // Reserved, with the broadcast address.
        || a >= 240;
    !is_special
}

fn is_public_v6(ip: Ipv6Addr) -> bool {
    if let Some(mapped) = ip.to_ipv4_mapped() {
        return is_public_v4(mapped);
    }
    let [a, b, ..] = ip.segments();
    // Only 2000::/3 is assigned to the public: what is left out are loopback,
    // unique local, link-local, multicast, and addresses that a NAT64 translates.
    a & 0xe000 == 0x2000
        // Protocol assignments, Teredo and benchmarks among them: 2001::/23.
        && !(a == 0x2001 && b & 0xfe00 == 0)
        // Documentation.
        && !(a == 0x2001 && b == 0x0db8)
        && !(a == 0x3fff && b & 0xf000 == 0)
        // 6to4 has an IPv4 address in it.
        && a != 0x2002
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPECIAL: [&str; 38] = [
        "0.0.0.0",
        "0.1.2.3",
        "10.0.0.1",
        "100.64.0.1",
        "100.127.255.255",
        "127.0.0.1",
        "127.255.0.1",
        "169.254.169.254",
        "169.254.170.2",
        "172.16.0.1",
        "172.31.255.255",
        "192.0.0.170",
        "192.0.2.1",
        "192.88.99.1",
        "192.168.1.1",
        "198.18.0.1",
        "198.19.255.1",
        "198.51.100.1",
        "203.0.113.9",
        "224.0.0.1",
        "240.0.0.1",
        "255.255.255.255",
        "::",
        "::1",
        "::127.0.0.1",
        "::ffff:127.0.0.1",
        "::ffff:169.254.169.254",
        "::ffff:10.0.0.1",
        "64:ff9b::7f00:1",
        "64:ff9b:1::1",
        "100::1",
        "2001::1",
        "2001:db8::1",
        "2002:7f00:1::",
        "3fff::1",
        "fd00:ec2::254",
        "fe80::1",
        "ff02::1",
    ];
    const PUBLIC: [&str; 10] = [
        "1.1.1.1",
        "8.8.8.8",
        "100.63.255.255",
        "100.128.0.1",
        "172.15.0.1",
        "172.32.0.1",
        "198.20.0.1",
        "223.255.255.255",
        "2606:4700::1",
        "::ffff:8.8.8.8",
    ];

    #[test]
    fn special_addresses_are_told_from_public_ones() {
        for text in SPECIAL {
            assert!(!is_public(text.parse().unwrap()), "{text}");
        }
        for text in PUBLIC {
            assert!(is_public(text.parse().unwrap()), "{text}");
        }
    }

    #[test]
    fn addresses_are_refused_however_they_are_written() {
        let policy = OutboundPolicy::default();
        for host in SPECIAL.iter().filter(|host| !host.contains(':')) {
            assert!(policy.check(&format!("https://{host}/")).is_err(), "{host}");
        }
        for host in SPECIAL.iter().filter(|host| host.contains(':')) {
            assert!(policy.check(&format!("https://[{host}]/")).is_err(), "{host}");
        }
        for host in ["2130706433", "0x7f.1", "0177.0.0.1", "127.1", "①②⑦.0.0.1", "[::ffff:7f00:1]"]
        {
            let found = policy.check(&format!("https://{host}:8443/hook"));
            assert!(matches!(found, Err(Refused::NotPublic(_))), "{host}: {found:?}");
        }
        assert!(policy.check("https://8.8.8.8/hook").is_ok());
        assert!(policy.check("https://studio.example/hook?job=1#part").is_ok());
    }

    #[test]
    fn urls_that_no_receiver_has_are_refused() {
        let policy = OutboundPolicy::default();
        let long = format!("https://studio.example/{}", "x".repeat(2048));
        for (text, why) in [
            ("", Refused::NotAUrl),
            ("/hook", Refused::NotAUrl),
            ("https://", Refused::NotAUrl),
            (&long, Refused::NotAUrl),
            ("http://studio.example/", Refused::Scheme),
            ("file:///etc/passwd", Refused::Scheme),
            ("gopher://studio.example/", Refused::Scheme),
            ("https://me:secret@studio.example/", Refused::Credentials),
            ("https://studio.example@127.0.0.1/", Refused::Credentials),
        ] {
            assert_eq!(policy.check(text), Err(why), "{text}");
        }
    }

    #[test]
    fn one_address_that_is_not_public_speaks_against_the_name() {
        let at = |texts: &[&str]| -> Vec<SocketAddr> {
            texts.iter().map(|text| SocketAddr::new(text.parse().unwrap(), 443)).collect()
        };
        let policy = OutboundPolicy::default();
        let check = |texts: &[&str]| policy.check_addresses("studio.example", at(texts));
        assert_eq!(check(&["8.8.8.8", "2606:4700::1"]), Ok(at(&["8.8.8.8", "2606:4700::1"])));
        for special in SPECIAL {
            let found = check(&["8.8.8.8", special]);
            assert_eq!(found, Err(Refused::NotPublic("studio.example".to_owned())), "{special}");
        }
    }

    #[test]
    fn trusted_hosts_may_be_anywhere_and_others_may_not() {
        let policy = OutboundPolicy {
            trusted_hosts: ["Farm.local", "127.0.0.1", "::1"].map(str::to_owned).to_vec(),
            allow_http: false,
        };
        for url in ["http://farm.local:9000/", "http://127.0.0.1:1/", "http://[::1]:1/"] {
            assert!(policy.check(url).is_ok(), "{url}");
        }
        let private = vec![SocketAddr::from(([10, 0, 0, 7], 80))];
        assert_eq!(policy.check_addresses("farm.local", private.clone()), Ok(private.clone()));
        assert!(policy.check_addresses("sub.farm.local", private).is_err());
        assert!(policy.check("http://127.0.0.2/").is_err());
        let http = OutboundPolicy { allow_http: true, ..OutboundPolicy::default() };
        assert!(http.check("http://studio.example/").is_ok());
        assert!(http.check("http://127.0.0.1/").is_err());
    }
}
