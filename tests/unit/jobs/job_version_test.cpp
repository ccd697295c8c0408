// Says when the version of jobs must increase.
#include <string>
#include <type_traits>

#include <gtest/gtest.h>

#include "base/sha256.h"
#include "proto/parameters.h"
#include "server/codec/mesher_version.h"
#include "server/jobs/queue/pipeline.h"

namespace isomesh::jobs {
namespace {

template <class T>
void add_values(std::string& all, const T& /*member*/) {
  if constexpr (Enumeration<T>) {
    all += names_of<T>();
  } else if constexpr (requires { typename T::value_type; }) {
    if constexpr (Enumeration<typename T::value_type>) all += names_of<typename T::value_type>();
  }
}

// All that a job can ask for, and how it is made.
std::string job_language() {
  std::string all = codec::kMesherVersion;
  JobParameters parameters;
  visit_leaves(parameters, [&](const std::string& path, const Parameter&, auto& member) {
    all += '\n' + path + ' ';
    add_values(all, member);
  });
  return all;
}

TEST(JobVersion, IncreasesWithWhatJobsCanAskForAndWithTheMesher) {
  EXPECT_EQ(std::to_string(kJobVersion) + ' ' + sha256_of(job_language()).substr(0, 16),
            "10 b8b836d3424653be")
      << "increase kJobVersion, and write the new line here; it stands for " << job_language();
}

}  // namespace
}  // namespace isomesh::jobs
