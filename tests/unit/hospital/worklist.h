// A workitem for the tests of the own worklist.
#pragma once

#include <string>

#include <gtest/gtest.h>

#include "base/clock.h"
#include "server/hospital/worklist/workitem.h"

namespace isomesh::test {

inline const store::Time kNoon = store::Time(std::chrono::hours(24 * 365 * 50 + 12));

inline nlohmann::json code(const std::string& value) {
  using worklist::attribute;
  return {{"00080100", attribute("SH", value)},
          {"00080102", attribute("SH", "99X")},
          {"00080104", attribute("LO", value)}};
}

// A data set that POST /workitems accepts.
inline worklist::DataSet scheduled() {
  using worklist::attribute;
  return {{"00741000", attribute("CS", "SCHEDULED")},
          {"00741200", attribute("CS", "MEDIUM")},
          {"00741204", attribute("LO", "Mesh of bone")},
          {"00404005", attribute("DT", "20260102030405")},
          {"00404041", attribute("CS", "READY")},
          {"00100020", attribute("LO", "PAT-1")},
          {"00100010", attribute("PN", {{"Alphabetic", "Doe^Jane"}})},
          {"0020000D", attribute("UI", "1.7")},
          {"00404018", attribute("SQ", code("MESH"))},
          {"00404021",
           {{"vr", "SQ"},
            {"Value", nlohmann::json::array(
                          {nlohmann::json::object({{"0020000D", attribute("UI", "1.7")},
                                                   {"0020000E", attribute("UI", "1.7.1")}})})}}}};
}

inline store::WorkitemRecord new_record() {
  return worklist::new_workitem("1.2.3", scheduled(), kNoon);
}

}  // namespace isomesh::test
