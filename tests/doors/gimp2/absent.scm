; A program that is not there. After checks.scm.

(with-picture "rgb.png" (lambda (image layer) (fact "absent" (refusal (lambda () (lay image layer))))))
(close-output-port facts)
