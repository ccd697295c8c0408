// What the sections of the report word in the same way.
#pragma once

#include <string>
#include <vector>

#include "tests/bench/report_sections.h"
#include "tests/bench/stages.h"

namespace isomesh::bench {

std::string percent(double share);
std::string scheme_name(Scheme scheme);
std::string title_of(const Samples& samples, const Subject::Level& level);
std::string peer_time(double ms);  // "-" for 0, which is what nobody measured

void write_table(const std::vector<Finding>& findings, Document& document);

// The smallest and the largest of some factors.
class Factors {
 public:
  void include(double factor);
  std::string text(int digits) const;  // "1.22 to 1.26"; one number where both read the same

 private:
  double low_ = 0;
  double high_ = 0;
  bool empty_ = true;
};

// Progress, to standard error.
void say(const std::string& what);

}  // namespace isomesh::bench
