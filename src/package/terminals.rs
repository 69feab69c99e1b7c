//! The two ends of the rod as ports, the tip as a loaded and as a driven one, for those who connect units by ports instead of by variables.
//!
//! Both terminals have members of the same names: the tip of one rod fits the base of another. Motion goes from tip to
//! base; the load goes the other way, as the reaction of the one is the tip load of the other, with the same sign. A
//! driven tip is as a base.

use crate::fmi2::description::{Xml, document};
use crate::fmi2::variables::{self, Variable};
use std::io;

/// Where in the archive the terminals lie.
pub const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";

/// Where in the archive of a model of this name the ports of the Open Simulation Platform lie. Its loader wants the file
/// beside the archive under this name.
pub fn ports_file(model: &str) -> String {
    format!("extra/com.open-simulation-platform/{model}_OspModelDescription.xml")
}

/// An end of the rod.
struct End {
    name: &'static str,
    description: &'static str,
    /// Rows of position, orientation, velocity, angular velocity, force and moment.
    rows: [&'static str; 6],
    /// Which way the load flows, seen from the rod.
    load: &'static str,
}

const MEMBERS: [&str; 6] = ["position", "orientation", "velocity", "angular_velocity", "force", "moment"];

const ENDS: [End; 3] = [
    End {
        name: "base",
        description: "Clamped end: pose and twist in, force and moment on the base out; world frame, about the base point",
        rows: [
            "base.position",
            "base.orientation",
            "base.velocity",
            "base.angular_velocity",
            "base.reaction_force",
            "base.reaction_moment",
        ],
        load: "outflow",
    },
    End {
        name: "tip",
        description: "Far end: pose and twist out, force and moment on the tip in; world frame, about the tip point",
        rows: ["tip.position", "tip.orientation", "tip.velocity", "tip.angular_velocity", "tip.force", "tip.moment"],
        load: "inflow",
    },
    End {
        name: "driven_tip",
        description: "Far end with tip.mode = 1: pose and twist in, force and moment on what drives the tip out; world frame, about the tip point",
        rows: [
            "tip.driven_position",
            "tip.driven_orientation",
            "tip.driven_velocity",
            "tip.driven_angular_velocity",
            "tip.reaction_force",
            "tip.reaction_moment",
        ],
        load: "outflow",
    },
];

/// The scalar variables of a row.
fn elements(row: &str) -> Vec<Variable> {
    variables::all().into_iter().filter(|variable| variable.row.name == row).collect()
}

/// `terminalsAndIcons.xml`, in the format of version 3.0, which is the one that version 2.0 refers to.
pub fn terminals() -> String {
    document(|xml| {
        xml.create_element("fmiTerminalsAndIcons").with_attribute(("fmiVersion", "3.0")).write_inner_content(
            |xml| {
                xml.create_element("Terminals")
                    .write_inner_content(|xml| ENDS.iter().try_for_each(|end| terminal(xml, end)))?;
                Ok(())
            },
        )?;
        Ok(())
    })
}

fn terminal(xml: &mut Xml, end: &End) -> io::Result<()> {
    let attributes = [("name", end.name), ("matchingRule", "plug"), ("description", end.description)];
    xml.create_element("Terminal").with_attributes(attributes).write_inner_content(|xml| {
        for (member, row) in MEMBERS.iter().zip(end.rows) {
            let kind = if matches!(*member, "force" | "moment") { end.load } else { "signal" };
            for (k, variable) in elements(row).iter().enumerate() {
                xml.create_element("TerminalMemberVariable")
                    .with_attributes([
                        ("variableName", variable.to_string().as_str()),
                        ("memberName", format!("{member}[{}]", k + 1).as_str()),
                        ("variableKind", kind),
                    ])
                    .write_empty()?;
            }
        }
        Ok(())
    })?;
    Ok(())
}

/// The ports in the terms of OSP-IS 1.0. Orientations have four elements, which only a generic group may have.
pub fn ports() -> String {
    const NAMESPACE: &str = "https://open-simulation-platform.com/OspModelDescription/1.0.0";
    document(|xml| {
        xml.create_element("OspModelDescription")
            .with_attributes([("xmlns", NAMESPACE), ("version", "1.0")])
            .write_inner_content(|xml| {
                xml.create_element("VariableGroups").write_inner_content(groups)?;
                Ok(())
            })?;
        Ok(())
    })
}

/// One kind of group after the other, as the schema has it.
fn groups(xml: &mut Xml) -> io::Result<()> {
    for End { rows: [_, orientation, ..], .. } in &ENDS {
        group(xml, "Generic", orientation)?;
    }
    for End { rows: [position, ..], .. } in &ENDS {
        group(xml, "LinearDisplacement", position)?;
    }
    for End { name, rows: [_, _, velocity, _, force, _], .. } in &ENDS {
        port(xml, "LinearMechanicalPort", &format!("{name}.linear"), [("Force", force), ("LinearVelocity", velocity)])?;
    }
    for End { name, rows: [_, _, _, omega, _, moment], .. } in &ENDS {
        port(
            xml,
            "AngularMechanicalPort",
            &format!("{name}.angular"),
            [("Torque", moment), ("AngularVelocity", omega)],
        )?;
    }
    Ok(())
}

fn port(xml: &mut Xml, element: &str, name: &str, pair: [(&str, &str); 2]) -> io::Result<()> {
    xml.create_element(element)
        .with_attribute(("name", name))
        .write_inner_content(|xml| pair.iter().try_for_each(|(element, row)| group(xml, element, row)))?;
    Ok(())
}

fn group(xml: &mut Xml, element: &str, row: &str) -> io::Result<()> {
    xml.create_element(element).with_attribute(("name", row)).write_inner_content(|xml| {
        for variable in elements(row) {
            let name = variable.to_string();
            let element = xml.create_element("Variable").with_attribute(("ref", name.as_str()));
            match variable.row.unit {
                "" => element.write_empty()?,
                unit => element.with_attribute(("unit", unit)).write_empty()?,
            };
        }
        Ok(())
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_have_all_that_moves_and_loads_them() {
        for end in &ENDS {
            let sizes = end.rows.map(|row| elements(row).len());
            assert_eq!(sizes, [3, 4, 3, 3, 3, 3], "{}", end.name);
        }
        // what a tip gives, a base or a driven tip takes
        let [base, tip, driven] = &ENDS;
        for end in [base, driven] {
            for (end, tip) in end.rows.iter().zip(tip.rows) {
                for (end, tip) in elements(end).iter().zip(elements(tip)) {
                    assert!(end.is_output() != tip.is_output() && end.row.unit == tip.row.unit, "{end}, {tip}");
                }
            }
        }
    }
}
