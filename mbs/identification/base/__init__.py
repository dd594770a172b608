"""How base inertial parameters are found: rules of trees and of loops, and the rank of samples."""
