// main() of test programs that import as the daemon does: by starting themselves again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/volume/import_worker.h"

int main(int argc, char** argv) {
  isomesh::volume::become_import_worker_if_asked(argc, argv);
  testing::InitGoogleMock(&argc, argv);
  return RUN_ALL_TESTS();
}
