// Of this project, and called like one of the library.
#pragma once

#define CONSUMER_BASE_ERROR_H 1
