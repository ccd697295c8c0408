// Answers with a value in every member, and none of them a default.
#pragma once

#include "proto/types.h"

namespace isomesh::test {

Volume some_volume();
Volume dicom_volume();
JobParameters some_parameters();
Problem some_problem();
Job queued_job();
Job succeeded_job();
Job failed_job();

}  // namespace isomesh::test
