// Names of lower layers that this folder uses without qualification.
#pragma once

#include "server/import/message/import_message.h"
#include "server/volume/canonical.h"
#include "server/volume/geometry.h"
#include "server/volume/unusable.h"

namespace isomesh::import {

using isomesh::bytes_per_sample;

using volume::axis_name;
using volume::CanonicalWriter;
using volume::check_limits;
using volume::check_raw;
using volume::find_fault;
using volume::geometry_of;
using volume::normalised;
using volume::SizeLimits;
using volume::step_of;
using volume::throw_choice;
using volume::throw_overridable;
using volume::throw_unusable;
using volume::Vector3;
using volume::volume_dims;

}  // namespace isomesh::import
