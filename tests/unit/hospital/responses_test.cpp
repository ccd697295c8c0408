#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "server/hospital/dicomweb/dicomweb.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::dicomweb {
namespace {

// The program misbehaves as the response says.
TEST(Responses, ThatCannotBeReadSayWhy) {
  jobs::ImportRunner runner(
      {.bounds = {.memory_bytes = std::uint64_t{128} << 20, .time = std::chrono::minutes(1)},
       .program = FAULTY_IMPORT});
  const test::TemporaryFolder folder;
  for (const auto& [what, reason] :
       {std::pair<std::string, std::string>{"run out of time",
                                            "reading the response of the PACS took too long"},
        {"crash", "the response of the PACS cannot be read"}}) {
    test::write_file(folder / "response", what);
    const Error error = test::error_of([&] { read_response(runner, folder / "response"); });
    EXPECT_EQ(error.code(), ErrorCode::kPacsUnreachable);
    EXPECT_EQ(error.what(), reason);
  }
}

}  // namespace
}  // namespace isomesh::dicomweb
